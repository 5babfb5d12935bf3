/* SPDX-License-Identifier: MIT */
/* What every port and the kernel ask of the compiler: GCC, clang, XC16. A port on another one brings its own. */
#ifndef HAL_COMPILER_H
#define HAL_COMPILER_H

#define HAL_USED __attribute__((used)) /* referenced from assembly only */
#define HAL_NORETURN __attribute__((noreturn))
#define HAL_LIKELY(condition) __builtin_expect(condition, 1)
#define HAL_INLINE inline __attribute__((always_inline)) /* hot, although the rest is optimised for size */
#define HAL_OUTLINE __attribute__((noinline))            /* cold */
#define HAL_ZEROS /* an object of zeros that nobody writes: cleared RAM is cheaper than flash */

/* What bounds of time and stack take from the source (toolchain/include/bounds.h); nothing to other compilers. n threads,
 * m events, b newer events in the same bucket, s subscriptions of one event, q queued messages, i times idle, u bytes of a
 * stack never used, k bytes of the largest stack; where they are told, t subscriptions of all events together, o of one
 * thread, h holes on a path of the heap's tree, j runs of pieces given back that wait to be joined (0 outside of handlers),
 * x holes that become larger than the reserve. */
#if defined(__clang__) && defined(__dsPIC30F__)
#include <bounds.h>
#else
#define LOOP_BOUND(rounds)
#define LOOP_TOTAL(rounds)
#define LOOP_SHARE(function, rounds)
#define SAME_LOOP()
#define ONE_LOOP()
#define LOOPS_OF(function, rounds) struct no_note
#define CALL_TARGETS(...)
#define CALL_SHARE(callee, function, times)
#define CALL_IF(callee, expression)
#define PRIVATE_VALUE(variable, value) struct no_note
#define KNOWN_VALUE(variable, value) struct no_note
#define ARGUMENT_BOUND(function, n, most) struct no_note
#define INTERRUPT_LEVEL(vector, level) struct no_note
#define OUTSIDE_ONLY(...) struct no_note
#define STACK_AREA(variable, bytes) struct no_note
#define THREADS(...) struct no_note
#define COMES_BACK(function, level) struct no_note
#define RESUMED_BY(...) struct no_note
#define LINKS_IN_RAM(...) struct no_note
#endif

/* The value of a macro as text; a condition without which the file is not compiled. */
#define HAL_TEXT(value) HAL_TEXT_(value)
#define HAL_TEXT_(text) #text
#define HAL_ASSUME(name, condition) typedef char name[(condition) ? 1 : -1]

/* The compiler moves no memory access across. */
static inline void hal_barrier(void)
{
    __asm__ volatile("" ::: "memory");
}

#endif
