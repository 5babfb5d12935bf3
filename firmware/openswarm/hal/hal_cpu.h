/* What a CPU port provides: contract here, code in port/<cpu>/. hal_port.h of the port defines the types, and those
 * functions of this list that are worth inlining. docs/porting.md walks through the list.
 *
 * Three levels of exclusion. The slice interrupt and everything that runs on the kernel stack outside ISRs is level
 * "slice"; ISRs that use the kernel are level "device". Code of a level cannot be interrupted by its own level.
 */
#ifndef HAL_CPU_H
#define HAL_CPU_H

#include <stdbool.h>
#include <stdint.h>

#include "openswarm_scheduler.h" /* sys_pcb; C99 allows a typedef once */

typedef sys_pcb *(*hal_pick)(void); /* kernel stack, slice level; returns the thread to resume */

#include "hal_port.h"
/* hal_port.h defines:
 *   HAL_USED, HAL_NORETURN        attributes: referenced from assembly only; does not return
 *   HAL_LIKELY(condition)         a hint for the order of branches
 *   HAL_INLINE, HAL_OUTLINE       attributes: always, never copied into the caller
 *   hal_lock_state                opaque level
 *   hal_limit                     type of a stack limit
 *   HAL_STACK_GUARD               bytes at the end of a thread's stack that belong to the port (hal_limits.h)
 *   HAL_STACK_GROWS_DOWN          if it does
 *   HAL_ALLOCATION_FAILS()        false; a test port may say true to make the next allocation fail
 * and declares or defines inline:
 *   hal_lock_state hal_lock_slice(void);      at least level slice; nests; any context
 *   hal_lock_state hal_lock_devices(void);    at least level device; nests; any context; held for <= 40 Tcy
 *   void hal_unlock(hal_lock_state before);   restore, never lower than before; takes what became due meanwhile
 *   bool hal_in_thread(void);                 level is below slice: a thread outside critical sections
 *   bool hal_in_isr(void);                    level is device or above
 *   void hal_barrier(void);                   the compiler moves no memory access across
 *   void hal_slice_restart(void);             a full slice starts now; a pending slice interrupt is withdrawn
 *   void hal_slice_force(void);               the slice ends as soon as the level allows; any context
 */

/* Before any other call. No interrupt is enabled until hal_start(); the level is thread. Adopts the running context
 * as process's; fills its sp and limit. */
void hal_init(sys_pcb *process);
/* 1 ms clock (calls os_clock_tick at level device) and slice timer start, interrupts are enabled. */
void hal_start(void);

/* Builds the first frame of a thread that will call entry(arg), then os_thread_returned(). stack..stack + bytes ends
 * where process begins. Fills process->sp and limit. Slice locked. False: no memory. */
bool hal_stack_init(sys_pcb *process, uint8_t *stack, uint16_t bytes, void (*entry)(void *), void *arg);
/* The thread is gone and not running; release what hal_stack_init took beside the block. */
void hal_stack_release(sys_pcb *process);
/* Save the calling thread, run os_slice_end() or os_schedule() on the kernel stack at level slice and resume the thread
 * it returns. Both come back when the caller is resumed, at thread level. */
void hal_yield(void); /* called at thread level */
void hal_block(void); /* called at level slice */
/* The caller's context is given up: resume what pick() returns. Called at level slice. */
HAL_NORETURN void hal_abandon(hal_pick pick);

/* Kernel stack, slice level: sleep until an interrupt, unless the low byte of *pending is set. Test and sleep are
 * one act: an interrupt that sets *pending after the test ends the sleep. Comes back at slice level with interrupts
 * taken. */
void hal_idle(const volatile uint16_t *pending);

/* After a fault: mask everything and stop for ever. An emulator knows the end of a run by the name of this function. */
HAL_NORETURN void hal_stop(void);

#endif
