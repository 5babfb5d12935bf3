/* SPDX-License-Identifier: MIT */
/* Compiler extensions used by the kernel and every port: GCC, clang, XC16. A port for another compiler has its own. */
#ifndef HAL_COMPILER_H
#define HAL_COMPILER_H

#define HAL_USED __attribute__((used)) /* referenced from assembly only */
#define HAL_NORETURN __attribute__((noreturn))
#define HAL_LIKELY(condition) __builtin_expect(condition, 1)
#define HAL_INLINE inline __attribute__((always_inline)) /* hot code in a file that is optimised for size */
#define HAL_OUTLINE __attribute__((noinline))            /* cold */
#define HAL_ZEROS /* an object of zeros that is never written: cleared RAM is cheaper than flash */

/* Annotations for `toolchain bounds` (toolchain/include/bounds.h); empty for other compilers. Names in them:
 *   n  threads                              m  events
 *   b  newer events in the same bucket      s  subscriptions of one event
 *   q  queued messages                      i  times idle
 *   u  bytes of a stack never used          k  bytes of the largest stack
 *   w  bytes of a polled I2C transfer
 * Of options:
 *   l  locked mutexes                       c  cleanup functions pushed
 *   y  quotas                               v  services
 *   r  running timers
 * Optional, for closer bounds:
 *   t  subscriptions of all events          o  subscriptions of one thread
 *   h  holes on a path of the heap's tree   j  free runs pending at a call (0 outside handlers)
 *   x  holes that become larger than the reserve */
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
#define BOUNDS_AT(text, ...) struct no_note
#define RECURSION_BOUND(function, count) struct no_note
#define TARGETS_OF(caller, ...) struct no_note
#define HIGHEST_LEVEL(level, ...) struct no_note
#define RESERVED_LEVEL(level, ...) struct no_note
#endif

/* HAL_TEXT: value of a macro as text. HAL_ASSUME: a condition checked at compile time. */
#define HAL_TEXT(value) HAL_TEXT_(value)
#define HAL_TEXT_(text) #text
#define HAL_ASSUME(name, condition) typedef char name[(condition) ? 1 : -1]

/* Compiler barrier: no memory access moves across it. */
static inline void hal_barrier(void)
{
    __asm__ volatile("" ::: "memory");
}

#endif
