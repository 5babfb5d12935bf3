/* SPDX-License-Identifier: MIT */
/* What a CPU port provides: contract here, code in port/<cpu>/. hal_port.h of the port defines the types, and those
 * functions of this list that are worth inlining. docs/porting.md walks through the list.
 *
 * Three levels of exclusion: thread, slice, device. The slice interrupt and all code on the kernel stack outside ISRs
 * run at level slice, ISRs that use the kernel at level device. Code of these two is not interrupted by its own level.
 *
 * Atomic accesses, which no interrupt can divide: the load or the store of one byte is atomic on every CPU, that of a
 * word (a pointer, or 16 bits) only on some. HAL_LOAD and HAL_STORE below therefore access the words that ISRs share
 * with lower levels without a lock. Reading, changing and writing back is atomic on no CPU: it takes a lock.
 * ISRs of level device use plain accesses, because no code that shares these words can interrupt
 * them.
 */
#ifndef HAL_CPU_H
#define HAL_CPU_H

#include <stdbool.h>
#include <stdint.h>

#include "openswarm_scheduler.h" /* sys_pcb; C99 allows a typedef once */

typedef sys_pcb *(*hal_pick)(void); /* kernel stack, slice level; returns the thread to resume */

#include "hal_compiler.h"
#include "hal_port.h"
/* hal_port.h defines:
 *   hal_lock_state                opaque level
 *   hal_limit                     type of a stack limit
 *   HAL_STACK_GUARD               bytes at the end of a thread's stack that belong to the port (hal_limits.h)
 *   HAL_STACK_TRAPS               1 if the CPU traps where a stack passes its limit; otherwise 0, or not defined
 *   HAL_KERNEL_STACK_GUARD        with HAL_STACK_TRAPS: bytes at the end of the kernel stack that such a trap needs
 *   HAL_STACK_GROWS_DOWN          if it does
 *   HAL_ALLOCATION_FAILS()        for tests: true makes the next allocation fail. Without it, never
 *   HAL_STACK_IS_TAKEN            if hal_stack_init takes resources that hal_stack_release must return
 *   HAL_WORD_IS_ONE_ACT           1 if loads and stores of a pointer and of 16 bits are atomic, else 0
 * and declares or defines inline:
 *   hal_lock_state hal_lock_slice(void);      at least level slice; nests; any context
 *   hal_lock_state hal_lock_devices(void);    at least level device; nests; any context; held for <= 40 Tcy
 *   void hal_unlock(hal_lock_state before);   restores the level, never below `before`; pending interrupts are taken
 *   bool hal_in_thread(void);                 level is below slice: a thread outside critical sections
 *   bool hal_in_isr(void);                    level is device or above
 *   void hal_slice_restart(uint16_t spent);   starts a slice with `spent` already used; withdraws a pending interrupt
 *                                             of the previous slice, but not a forced one
 *   uint16_t hal_slice_spent(void);           used part of the slice, in units of the port's choice
 *   bool hal_slice_is_over(void);             whether the slice has expired since it was restarted
 *   void hal_slice_force(void);               requests the slice interrupt as soon as the level allows, before the
 *                                             slice expires; any context. A superfluous request is harmless
 *   void hal_slice_unforce(void);             withdraws a forced interrupt that has not been taken yet
 *   void hal_guard_kernel_stack(void);        with HAL_STACK_TRAPS: kernel stack, slice level; sets the stack limit to
 *                                             the kernel stack's until a thread is resumed. ISRs on that stack set and
 *                                             restore it
 */

#if !HAL_STACK_TRAPS /* the kernel checks the paint at the end of its stack after every round of handlers */
#define HAL_KERNEL_STACK_GUARD 0
#define hal_guard_kernel_stack() ((void)0)
#endif

#ifndef HAL_ALLOCATION_FAILS
#define HAL_ALLOCATION_FAILS() false
#endif

#if HAL_WORD_IS_ONE_ACT
#define HAL_LOAD(place) (*(const volatile __typeof__(place) *)&(place))
#define HAL_STORE(place, value) (*(volatile __typeof__(place) *)&(place) = (value))
#else
#define HAL_LOAD(place)                                                                       \
    __extension__({                                                                           \
        hal_lock_state hal_lock_ = hal_lock_devices();                                        \
        __typeof__(place) hal_value_ = (place);                                               \
        (hal_unlock)(hal_lock_); /* not a test's macro of that name */                        \
        hal_value_;                                                                           \
    })
#define HAL_STORE(place, value)                                                               \
    do {                                                                                      \
        __typeof__(place) hal_value_ = (value); /* not under the lock: hal_in_isr() */       \
        hal_lock_state hal_lock_ = hal_lock_devices();                                        \
        (place) = hal_value_;                                                                 \
        (hal_unlock)(hal_lock_); /* not a test's macro of that name */                        \
    } while (0)
#endif

/* Atomic change of a word or byte: one instruction if the CPU has one, otherwise under a lock. */
#ifndef HAL_ADD
#define HAL_ADD(object, member, amount)                                                       \
    do {                                                                                      \
        hal_lock_state hal_lock_ = hal_lock_devices();                                        \
        (object).member = (uint16_t)((object).member + (amount));                             \
        hal_unlock(hal_lock_);                                                                \
    } while (0)
#endif
#ifndef HAL_CLEAR_BIT
#define HAL_CLEAR_BIT(variable, bit)                                                          \
    do {                                                                                      \
        hal_lock_state hal_lock_ = hal_lock_devices();                                        \
        (variable) &= (uint16_t)~(1u << (bit));                                               \
        hal_unlock(hal_lock_);                                                                \
    } while (0)
#endif

/* Called before any other function. Until hal_start() interrupts stay disabled and the level is slice, so that blocking
 * calls are refused. Adopts the running context as that of process and sets its sp and limit. */
void hal_init(sys_pcb *process);
/* Starts the 1 ms clock (which calls os_clock_tick at level device) and the slice timer, and enables interrupts. The
 * level stays slice. The kernel then calls hal_unlock(HAL_THREAD_LEVEL), which takes a slice interrupt forced
 * before. */
void hal_start(void);

/* Builds the first frame of a thread that calls entry(arg), then os_thread_returned(). The stack ends where process
 * begins. Sets process->sp and limit. Slice locked. False: out of memory. */
bool hal_stack_init(sys_pcb *process, uint8_t *stack, uint16_t bytes, void (*entry)(void *), void *arg);
/* Releases resources that hal_stack_init took besides the block. The thread has ended and does not run. */
#ifdef HAL_STACK_IS_TAKEN
void hal_stack_release(sys_pcb *process);
#else
static inline void hal_stack_release(const sys_pcb *process)
{
    (void)process;
}
#endif
/* Save the calling thread, run os_yield() or os_schedule() on the kernel stack at level slice and resume the thread
 * it returns. Both return when the caller is resumed, at thread level. The slice interrupt does the same
 * with os_slice_end(). */
void hal_yield(void); /* called at thread level */
void hal_block(void); /* called at level slice */
/* Discards the caller's context and resumes the thread that pick() returns. Called at level slice. */
HAL_NORETURN void hal_abandon(hal_pick pick);

/* Kernel stack, slice level: sleeps until an interrupt, unless the low byte of *pending is set. Test and sleep are
 * atomic: an interrupt that sets *pending after the test ends the sleep. Returns at slice level with interrupts
 * taken. */
void hal_idle(const volatile uint16_t *pending);

/* Masks all interrupts and stops for ever, after a fault. Emulators recognise the end of a run by this function's
 * name. */
HAL_NORETURN void hal_stop(void);

#endif
