/* dsPIC30F: the level is the CPU's interrupt priority (IPL, SR<7:5>). 0 thread, 1 slice and kernel stack, 4 devices;
 * 5 is the stepper and 6 the camera, which never call the kernel and are masked by nothing but idle (kernel level 4
 * only). */
#ifndef HAL_PORT_H
#define HAL_PORT_H

#include <p30F6014A.h>

#include "hal_limits.h"

#define HAL_USED __attribute__((used))
#define HAL_NORETURN __attribute__((noreturn))
#define HAL_LIKELY(condition) __builtin_expect(condition, 1)
#define HAL_INLINE inline __attribute__((always_inline)) /* hot, although the rest is optimised for size */
#define HAL_OUTLINE __attribute__((noinline))            /* cold */
#define HAL_ALLOCATION_FAILS() false

typedef uint16_t hal_lock_state; /* SR */
typedef uint16_t hal_limit;

#define CPU_TEXT_(x) #x
#define CPU_TEXT(x) CPU_TEXT_(x)

#define CPU_SRL (*(volatile uint8_t *)&SR)
enum { CPU_IPL_DEVICE = 0x80, CPU_IPL = 0xE0 };

static HAL_INLINE hal_lock_state hal_lock_slice(void)
{
    hal_lock_state before = SR;
    uint16_t room;
    /* A read above the stack limit traps (isa.md §10): too little room ends the thread here, not half-way. Device levels
     * stay. After the IPL rises one more instruction may run at the old one (isa.md §14.3): a harmless one. */
    __asm__ volatile("mov [w15+" CPU_TEXT(HAL_CALL_DEPTH) "], %0\n\tbtss %1, #7\n\tbset _SR, #5\n\tnop"
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
    SR = before; /* one instruction more if it were only the low byte */
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
