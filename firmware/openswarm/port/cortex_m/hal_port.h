/* SPDX-License-Identifier: MIT */
/* Cortex-M: the level is BASEPRI or the running exception. Threads run on the process stack. PendSV, the lowest
 * exception, is level slice and runs scheduler and handlers on the main stack. Interrupts from DEVICE to below
 * PendSV may call the kernel, those above must not. Chips with four priority bits have only priorities with a low
 * nibble of 0. */
#ifndef HAL_PORT_H
#define HAL_PORT_H

#include "registers.h"

#define HAL_STACK_GROWS_DOWN
#define HAL_STACK_IS_TAKEN /* hal_stack_release() disables the thread's guard */
#define HAL_WORD_IS_ONE_ACT 1

typedef uint32_t hal_lock_state; /* BASEPRI */
#define HAL_THREAD_LEVEL 0
typedef uint32_t hal_limit;      /* MPU_RBAR of the guard: its address, CPU_GUARD_REGION */

enum { CPU_PRIORITY_DEVICE = 0x50, CPU_PRIORITY_SLICE = 0xF0, CPU_SLICE_MS = 10, CPU_PENDSV = 14 };

extern volatile uint8_t cpu_slice_ms; /* ms left of the slice */
extern volatile bool cpu_forced;      /* PendSV is pending for another reason */
extern volatile hal_pick cpu_pick;    /* called by PendSV, returns the next thread; NULL: a slice has ended */

#if SYS_CHECK_LEVELS
void cpu_check_level(void); /* stops the system if the running interrupt may not call the kernel */
#else
#define cpu_check_level() (void)0
#endif

/* BASEPRI_MAX only raises, and takes effect with the next instruction. */
static HAL_INLINE hal_lock_state cpu_raise(uint32_t priority)
{
    hal_lock_state before;
    cpu_check_level();
    __asm__ volatile("mrs %0, basepri\n\tmsr basepri_max, %1" : "=&r"(before) : "r"(priority) : "memory");
    return before;
}

static HAL_INLINE hal_lock_state hal_lock_slice(void)
{
    return cpu_raise(CPU_PRIORITY_SLICE);
}

static HAL_INLINE hal_lock_state hal_lock_devices(void)
{
    return cpu_raise(CPU_PRIORITY_DEVICE);
}

static HAL_INLINE void hal_unlock(hal_lock_state before)
{
    __asm__ volatile("msr basepri, %0" ::"r"(before) : "memory");
}

static HAL_INLINE uint32_t cpu_exception(void)
{
    uint32_t number;
    __asm__ volatile("mrs %0, ipsr" : "=r"(number));
    return number;
}

static HAL_INLINE uint32_t cpu_masked_from(void)
{
    uint32_t priority;
    __asm__ volatile("mrs %0, basepri" : "=r"(priority));
    return priority;
}

static HAL_INLINE bool hal_in_thread(void)
{
    return (cpu_exception() | cpu_masked_from()) == 0;
}

static HAL_INLINE bool hal_in_isr(void)
{
    uint32_t exception = cpu_exception();
    return (exception != 0 && exception != CPU_PENDSV) || cpu_masked_from() - 1u < CPU_PRIORITY_DEVICE;
}

static HAL_INLINE void hal_slice_restart(uint16_t spent)
{
    cpu_slice_ms = (uint8_t)(CPU_SLICE_MS - spent);
    SCB_ICSR = SCB_ICSR_PENDSVCLR;
    if (cpu_forced) {
        SCB_ICSR = SCB_ICSR_PENDSVSET;
    }
}

static HAL_INLINE uint16_t hal_slice_spent(void)
{
    return (uint16_t)(CPU_SLICE_MS - cpu_slice_ms);
}

static HAL_INLINE bool hal_slice_is_over(void)
{
    return cpu_slice_ms == 0;
}

static HAL_INLINE void hal_slice_force(void)
{
    cpu_forced = true;
    SCB_ICSR = SCB_ICSR_PENDSVSET;
}

/* Either devices are locked, or hal_slice_restart() follows before the level opens: it repairs PendSV if an interrupt comes
 * in between. The end of a slice and pend_and_open() pend PendSV, too. */
static HAL_INLINE void hal_slice_unforce(void)
{
    cpu_forced = false;
    if (cpu_slice_ms != 0 && cpu_pick == NULL) {
        SCB_ICSR = SCB_ICSR_PENDSVCLR;
    }
}

#endif
