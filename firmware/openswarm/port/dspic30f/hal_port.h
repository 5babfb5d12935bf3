/* dsPIC30F: the level is the CPU's interrupt priority (IPL, SR<7:5>). 0 thread, 1 slice and kernel stack, 4 devices;
 * 5 is the stepper and 6 the camera, which never call the kernel and are masked by nothing but idle (kernel level 4
 * only). */
#ifndef HAL_PORT_H
#define HAL_PORT_H

#include <p30F6014A.h>

#include "hal_limits.h"

#define HAL_USED __attribute__((used))
#define HAL_NORETURN __attribute__((noreturn))
#define HAL_UNLIKELY(condition) __builtin_expect(condition, 0)
#define HAL_INLINE inline __attribute__((always_inline)) /* hot, although the rest is optimised for size */
#define HAL_OUTLINE __attribute__((noinline))            /* cold */
#define HAL_ALLOCATION_FAILS() false

typedef uint16_t hal_lock_state; /* SR; its low byte is restored */
typedef uint16_t hal_limit;

#define CPU_TEXT_(x) #x
#define CPU_TEXT(x) CPU_TEXT_(x)
#ifdef OS_W0 /* this toolchain spells working registers in clobber lists in its own way (dspic_compiler.h) */
#define CPU_W0 OS_W0
#else
#define CPU_W0 "w0"
#endif

#define CPU_SRL (*(volatile uint8_t *)&SR)
enum { CPU_IPL_SLICE = 0x20, CPU_IPL_DEVICE = 0x80, CPU_IPL = 0xE0 };

/* After a write that raises the IPL one more instruction may run at the old one (isa.md §14.3): give it a harmless
 * one. */
static HAL_INLINE void cpu_raise_ipl(uint8_t bit)
{
    CPU_SRL |= bit;
    __asm__ volatile("nop" ::: "memory");
}

static HAL_INLINE hal_lock_state hal_lock_slice(void)
{
    hal_lock_state before = SR;
    /* A read above the stack limit traps (isa.md §10): too little room ends the thread here, not half-way. Level device
     * or above stays; otherwise IPL 1, and the NOP is the harmless instruction of cpu_raise_ipl(). */
    __asm__ volatile("mov [w15+" CPU_TEXT(HAL_CALL_DEPTH) "], w0\n\tbtss %0, #7\n\tbset _SR, #5\n\tnop" ::"r"(before)
                     : CPU_W0, "memory");
    return before;
}

static HAL_INLINE void hal_enter_slice(void)
{
    cpu_raise_ipl(CPU_IPL_SLICE);
}

static HAL_INLINE hal_lock_state hal_lock_devices(void)
{
    hal_lock_state before = SR;
    cpu_raise_ipl(CPU_IPL_DEVICE);
    return before;
}

static HAL_INLINE void hal_unlock(hal_lock_state before)
{
    __asm__ volatile("" ::: "memory");
    CPU_SRL = (uint8_t)before;
}

static HAL_INLINE bool hal_in_thread(void)
{
    return (CPU_SRL & CPU_IPL) == 0;
}

static HAL_INLINE bool hal_in_isr(void)
{
    return (CPU_SRL & CPU_IPL_DEVICE) != 0;
}

static HAL_INLINE void hal_barrier(void)
{
    __asm__ volatile("" ::: "memory");
}

static HAL_INLINE void hal_slice_restart(void)
{
    TMR2 = 0; /* also clears the prescaler */
    IFS0bits.T2IF = 0;
}

static HAL_INLINE void hal_slice_force(void)
{
    IFS0bits.T2IF = 1;
}

#endif
