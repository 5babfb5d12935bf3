/* SPDX-License-Identifier: MIT */
/* What `python -m toolchain bounds` cannot find out by itself, told beside the code.  Each is a declaration: no instruction
 * and no byte of memory comes of it; in the image it is a line of the section .note.bounds.
 *
 * Numbers are expressions of integers, names, + - * / and min(...); a name gets its value on the command line (--let n=4).
 * In min(...) what has no value does not count.
 */
#ifndef _BOUNDS_H_
#define _BOUNDS_H_

/* A note "in front of" something is of one line: its own, if code stands there, else the next of its function that has
 * code. Functions and variables are those that its file can see; `file.c/name` is a static one of another file, without
 * which naming that is an error.
 *
 * In front of a loop, or of the `while` that ends one: it goes round at most `rounds` times. It counts for the innermost
 * loop of the machine code with an instruction of that line. Where one loop of the source has become two, one within the
 * other, SAME_LOOP in front of a line of the inner one says so: they share their rounds. Where several ways lead back to
 * the beginning of a loop of the machine code, it may be two of the source in one, and has no bound until ONE_LOOP beside
 * the note says that it is one. */
#define LOOP_BOUND(rounds) _BOUNDS_NOTE("loop", rounds)
#define SAME_LOOP() _BOUNDS_NOTE("same", .)
#define ONE_LOOP() _BOUNDS_NOTE("one", .)
/* On the line of a LOOP_BOUND, or alone: in one call of whatever is looked at, all rounds of the loop together, however often
 * it is entered, are at most `rounds`. Of the two ways to count, the one that gives less is taken. */
#define LOOP_TOTAL(rounds) _BOUNDS_NOTE("total", rounds)
/* On the line of a LOOP_BOUND, once for each function: in one call of that function, this loop and all others that say the
 * same go round at most `rounds` times together. Of functions that are under way at once the outermost counts. */
#define LOOP_SHARE(function, rounds) _BOUNDS_NOTE("share", function rounds)
/* Anywhere: the loops of this function, which may be assembly, go round at most `rounds` times. */
#define LOOPS_OF(function, rounds) _BOUNDS_NOTE("loops", function rounds)
/* In front of a call through a pointer: its targets are the functions named, of a type named all whose address is taken,
 * without those behind a minus. */
#define CALL_TARGETS(...) _BOUNDS_NOTE("calls", __VA_ARGS__)
/* In front of a call of `callee`, which is no inlined one: in one call of `function` it is made at most so often, all its
 * copies and all calls of `callee` in that line together. */
#define CALL_SHARE(callee, function, times) _BOUNDS_NOTE("often", callee function times)
/* In front of a call of `callee`: it is made only where this is not 0. */
#define CALL_IF(callee, expression) _BOUNDS_NOTE("if", callee expression)
/* Anywhere: looked at by itself, the function finds in register Wn at most `most`. */
#define ARGUMENT_BOUND(function, n, most) _BOUNDS_NOTE("argument", function n most)
/* Anywhere: the function leaves its stack to another, and comes back to its caller at this interrupt level. */
#define COMES_BACK(function, level) _BOUNDS_NOTE("back", function level)
/* Anywhere: where code goes on that has just moved to a stack of somebody else, each at most once. */
#define RESUMED_BY(...) _BOUNDS_NOTE("resumed", __VA_ARGS__)
/* Anywhere: the first bytes of this variable are the stack that interrupts and the kernel move to. */
#define STACK_AREA(variable, bytes) _BOUNDS_NOTE("stack", variable bytes)
/* Anywhere: functions of these types whose address is taken are entries of threads. */
#define THREADS(...) _BOUNDS_NOTE("threads", __VA_ARGS__)
/* Anywhere: the priority this interrupt is given, where it is not that after a reset, 4. */
#define INTERRUPT_LEVEL(vector, level) _BOUNDS_NOTE("level", vector level)
/* In a file: what a call keeps in this variable it finds again; threads enter with this value. */
#define PRIVATE_VALUE(variable, value) _BOUNDS_NOTE("private", variable value)
/* Anywhere: these interrupts come only where PRIVATE_VALUEs are what threads enter with. */
#define OUTSIDE_ONLY(...) _BOUNDS_NOTE("outside", __VA_ARGS__)
/* Anywhere: this variable or register has this value whenever anything looked at is entered. */
#define KNOWN_VALUE(variable, value) _BOUNDS_NOTE("known", variable value)
/* In a file: its pointers that are kept in memory lead to RAM, so that following them never takes the cycles of a constant.
 * With a name, said of that file of the same folder, which may be assembly. */
#define LINKS_IN_RAM(...) _BOUNDS_NOTE("ram", . __VA_ARGS__)

#define _BOUNDS_NOTE(kind, ...) _BOUNDS_LINE(__COUNTER__, __LINE__, kind, __VA_ARGS__)
#define _BOUNDS_LINE(number, line, kind, ...) _BOUNDS_TEXT(number, line, kind, __VA_ARGS__)
#define _BOUNDS_TEXT(number, line, kind, ...)                                                                       \
    static const char _bounds_##number[] __attribute__((used, nodebug, section(".note.bounds"))) =                           \
        kind " " #__VA_ARGS__ "@" __FILE__ ":" #line "\n"

#endif
