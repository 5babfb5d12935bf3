/* SPDX-License-Identifier: MIT */
/* dsPIC30F: the level is the CPU's interrupt priority (IPL, SR<7:5>): 0 thread, 1 slice and kernel stack, 4 devices,
 * 5 stepper, 6 camera. Stepper and camera never call the kernel, whose locks only raise the IPL to 4; only idle
 * masks them. */
#ifndef HAL_PORT_H
#define HAL_PORT_H

#include <p30F6014A.h>

#include "hal_limits.h"

#define HAL_STACK_TRAPS 1
#define HAL_WORD_IS_ONE_ACT 1 /* no instruction is interrupted (isa.md §14.2) */

/* For global variables in near data memory. */
#define HAL_ADD(object, member, amount)                                                                               \
    __asm__ volatile("mov %0, w0\n\tadd _" #object "+%1" : : "r"((uint16_t)(amount)),                                  \
                     "i"(offsetof(__typeof__(object), member)) : "w0", "cc", "memory")
#define HAL_CLEAR_BIT(variable, bit) __asm__ volatile("bclr.b _" #variable ", #" #bit : : : "memory")

typedef uint16_t hal_lock_state; /* SR */
#define HAL_THREAD_LEVEL 0
typedef uint16_t hal_limit;

#define CPU_SRL (*(volatile uint8_t *)&SR)
enum { CPU_IPL_SLICE = 0x20, CPU_IPL_DEVICE = 0x80, CPU_IPL = 0xE0 };

static HAL_INLINE hal_lock_state hal_lock_slice(void)
{
    hal_lock_state before = SR;
    uint16_t room;
    /* A read above the stack limit traps (isa.md §10): a lack of stack ends the thread here, not half-way through
     * the call. Device levels stay. One more instruction may run at the old IPL (isa.md §14.3), so it is a harmless
     * one. */
    __asm__ volatile("mov [w15+" HAL_TEXT(HAL_CALL_DEPTH) "], %0\n\tbtss %1, #7\n\tbset _SR, #5\n\tnop"
                     : "=&r"(room) : "r"(before) : "memory");
    return before;
}

static HAL_INLINE hal_lock_state hal_lock_devices(void)
{
    hal_lock_state before = SR;
    CPU_SRL |= CPU_IPL_DEVICE;
    __asm__ volatile("nop" ::: "memory");
    return before;
}

static HAL_INLINE void hal_unlock(hal_lock_state before)
{
    __asm__ volatile("" ::: "memory");
    SR = before; /* a store of only the low byte takes one more instruction */
}

static HAL_INLINE void hal_guard_kernel_stack(void)
{
    uint16_t limit;
    __asm__ volatile("mov #_os_memory+" HAL_TEXT(HAL_KERNEL_STACK_LIMIT) ", %0\n\tmov %0, SPLIM" : "=r"(limit));
}

static HAL_INLINE bool hal_in_thread(void)
{
    return (CPU_SRL & CPU_IPL) == 0;
}

static HAL_INLINE bool hal_in_isr(void)
{
    return (CPU_SRL & CPU_IPL_DEVICE) != 0;
}

/* Forced slice ends use another interrupt, CAN2's, whose entry clears it, so that T2IF means that the slice has
 * expired. */
static HAL_INLINE void hal_slice_restart(uint16_t spent)
{
    TMR2 = spent; /* also clears the prescaler */
    IFS0bits.T2IF = 0;
}

#define hal_slice_spent() TMR2
#define hal_slice_is_over() IFS0bits.T2IF
#define hal_slice_force() ((void)(IFS2bits.C2IF = 1))
#define hal_slice_unforce() ((void)(IFS2bits.C2IF = 0))

#endif
