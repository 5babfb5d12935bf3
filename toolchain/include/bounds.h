/* SPDX-License-Identifier: MIT */
/* Annotations for `python -m toolchain bounds`.  Each is a declaration without code and data: it becomes a line of the
 * section .note.bounds of the image.
 *
 * Numbers are expressions of integers, names, + - * / and min(...).  The command line defines values of names (--let n=4).
 * Arguments of min(...) without a value are ignored.
 */
#ifndef _BOUNDS_H_
#define _BOUNDS_H_

/* An annotation before a statement applies to one line: its own if it has code, else the next line of the function that
 * has code.  Names of functions and variables are resolved in the scope of the file; `file.c/name` is a static name of
 * another file.
 *
 * LOOP_BOUND: before a loop, or before the `while` that ends one. The loop has at most `rounds` iterations per entry.  The
 * annotation applies to the innermost loop of the machine code with an instruction of that line.
 * SAME_LOOP: before a line of an inner loop of the machine code that comes from the same source loop as the outer loop.
 * ONE_LOOP: a loop of the machine code with several back edges is one loop of the source.  Without it such a loop has no
 * bound, because it may be two loops of the source. */
#define LOOP_BOUND(rounds) _BOUNDS_NOTE("loop", rounds)
#define SAME_LOOP() _BOUNDS_NOTE("same", .)
#define ONE_LOOP() _BOUNDS_NOTE("one", .)
/* On the line of a LOOP_BOUND, or alone: the loop has at most `rounds` iterations over all its entries in one call of the
 * analysed function.  If both are given, the smaller result is the bound. */
#define LOOP_TOTAL(rounds) _BOUNDS_NOTE("total", rounds)
/* On the line of a LOOP_BOUND, once for each function: in one call of `function`, this loop and all others with an equal
 * annotation have at most `rounds` iterations together.  If several such functions are active, the outermost counts. */
#define LOOP_SHARE(function, rounds) _BOUNDS_NOTE("share", function rounds)
/* Anywhere: the loops of this function have at most `rounds` iterations.  A label of assembly at the head of a loop stands
 * for that loop. */
#define LOOPS_OF(function, rounds) _BOUNDS_NOTE("loops", function rounds)
/* Before a call through a pointer: its targets are the listed functions; a listed type stands for all its functions whose
 * address is taken; a minus excludes a function. */
#define CALL_TARGETS(...) _BOUNDS_NOTE("calls", __VA_ARGS__)
/* Anywhere, for assembly: the same for the calls through pointers after the label or in the function `caller`.  Targets of
 * several such annotations add up. */
#define TARGETS_OF(caller, ...) _BOUNDS_NOTE("targets", caller __VA_ARGS__)
/* Before a call of `callee` that is not inlined: one call of `function` makes it at most `times` times, counting all copies
 * of the call and all calls of `callee` in that line. */
#define CALL_SHARE(callee, function, times) _BOUNDS_NOTE("often", callee function times)
/* Before a call of `callee`: the call is executed only if `expression` is not 0. */
#define CALL_IF(callee, expression) _BOUNDS_NOTE("if", callee expression)
/* Anywhere: if the function is analysed as an entry, register Wn is at most `most`. */
#define ARGUMENT_BOUND(function, n, most) _BOUNDS_NOTE("argument", function n most)
/* Anywhere: at most `count` activations of the function exist at once. */
#define RECURSION_BOUND(function, count) _BOUNDS_NOTE("recursion", function count)
/* Anywhere: the function switches to another stack, and returns to its caller at this CPU priority. */
#define COMES_BACK(function, level) _BOUNDS_NOTE("back", function level)
/* Anywhere: functions in which execution continues after a switch to the stack of another thread, each at most once. */
#define RESUMED_BY(...) _BOUNDS_NOTE("resumed", __VA_ARGS__)
/* Anywhere: the first `bytes` of this variable are the second stack, which interrupts and the kernel switch to. */
#define STACK_AREA(variable, bytes) _BOUNDS_NOTE("stack", variable bytes)
/* Anywhere: functions of these types whose address is taken are thread entries. */
#define THREADS(...) _BOUNDS_NOTE("threads", __VA_ARGS__)
/* Anywhere: the priority of this interrupt, if it is not the reset value 4. */
#define INTERRUPT_LEVEL(vector, level) _BOUNDS_NOTE("level", vector level)
/* Anywhere: code of these files or folders runs at CPU priority `level` at most, copies inlined into other code included.
 * The linker refuses an interrupt of a higher level from which it can be reached.  A handler's own file is exempt. */
#define HIGHEST_LEVEL(level, ...) _BOUNDS_NOTE("highest", level __VA_ARGS__)
/* Anywhere: only these interrupts have this level. */
#define RESERVED_LEVEL(level, ...) _BOUNDS_NOTE("reserved", level __VA_ARGS__)
/* In a file: only the analysed code changes this variable; threads start with this value. */
#define PRIVATE_VALUE(variable, value) _BOUNDS_NOTE("private", variable value)
/* Anywhere: these interrupts occur only while PRIVATE_VALUEs have their value. */
#define OUTSIDE_ONLY(...) _BOUNDS_NOTE("outside", __VA_ARGS__)
/* Anywhere: this variable or register has this value at every entry. */
#define KNOWN_VALUE(variable, value) _BOUNDS_NOTE("known", variable value)
/* In a file: pointers that its code loads from memory point to RAM, so that dereferencing them costs no PSV cycles.
 * With a name, it applies to that file in the same folder, which may be assembly. */
#define LINKS_IN_RAM(...) _BOUNDS_NOTE("ram", . __VA_ARGS__)

/* Above a function, in the compiled file: annotations of the one line of the function that contains `text`, so that the
 * function itself reads without them.  Each is one of
 *     loop ROUNDS, total ROUNDS, share FUNCTION ROUNDS, one, same         as LOOP_BOUND, LOOP_TOTAL, LOOP_SHARE, ...
 *     calls TARGET, calls (TARGET, ...), often CALLEE FUNCTION TIMES, if CALLEE EXPRESSION
 *                                                                         as CALL_TARGETS, CALL_SHARE, CALL_IF
 * Example: BOUNDS_AT("while (*link", loop s, share remove_all n * s);  */
#define BOUNDS_AT(text, ...) _BOUNDS_AT(__COUNTER__, __LINE__, __VA_ARGS__)
#define _BOUNDS_AT(number, line, ...) _BOUNDS_OTHER_LINE(number, line, __VA_ARGS__)
#define _BOUNDS_OTHER_LINE(number, line, ...) _BOUNDS_LINE(number, _BOUNDS_AT_##line, "at", __VA_ARGS__)

#define _BOUNDS_NOTE(kind, ...) _BOUNDS_LINE(__COUNTER__, __LINE__, kind, __VA_ARGS__)
#define _BOUNDS_LINE(number, line, kind, ...) _BOUNDS_TEXT(number, line, kind, __VA_ARGS__)
#define _BOUNDS_TEXT(number, line, kind, ...)                                                                       \
    static const char _bounds_##number[] __attribute__((used, nodebug, section(".note.bounds"))) =                           \
        kind " " #__VA_ARGS__ "@" __FILE__ ":" #line "\n"

#endif
