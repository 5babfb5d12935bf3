/* SPDX-License-Identifier: MIT */
/* RISC-V, machine mode: the level is two bits. mie.MSIE permits the software interrupt, which ends a slice; clear = level
 * slice. mstatus.MIE permits every interrupt; clear = level device. One instruction reads and changes such a bit. */
#ifndef HAL_PORT_H
#define HAL_PORT_H

#include "registers.h"

#define HAL_STACK_GROWS_DOWN
#define HAL_WORD_IS_ONE_ACT 1

/* Bits that the matching unlock sets again. The compiler knows which bit a lock cleared, and omits the other test. */
typedef uint32_t hal_lock_state;
typedef uint32_t *hal_limit; /* lowest word of the stack */

enum { CPU_OPEN = MIE_MSIE, CPU_ENABLED = MSTATUS_MIE << 1, CPU_SLICE_MS = 10 };

#define HAL_THREAD_LEVEL CPU_OPEN

extern volatile uint8_t cpu_slice_ms; /* ms left of the slice */
extern volatile bool cpu_forced;      /* hal_slice_force() requested the software interrupt */

static HAL_INLINE hal_lock_state hal_lock_slice(void)
{
    return CSR_CLEAR(mie, MIE_MSIE) & MIE_MSIE;
}

static HAL_INLINE hal_lock_state hal_lock_devices(void)
{
    return (CSR_CLEAR(mstatus, MSTATUS_MIE) & MSTATUS_MIE) << 1;
}

static HAL_INLINE void hal_unlock(hal_lock_state before)
{
    hal_barrier();
    if (before & CPU_OPEN) {
        CSR_SET(mie, MIE_MSIE);
    }
    if (before & CPU_ENABLED) {
        CSR_SET(mstatus, MSTATUS_MIE);
    }
}

static HAL_INLINE bool hal_in_isr(void)
{
    return !(CSR_READ(mstatus) & MSTATUS_MIE);
}

static HAL_INLINE bool hal_in_thread(void)
{
    return (CSR_READ(mie) & MIE_MSIE) && !hal_in_isr();
}

static HAL_INLINE void hal_slice_restart(uint16_t spent)
{
    cpu_slice_ms = (uint8_t)(CPU_SLICE_MS - spent);
    REGISTER(CLINT_MSIP) = 0;
    if (cpu_forced) {
        REGISTER(CLINT_MSIP) = 1;
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
    REGISTER(CLINT_MSIP) = 1;
}

/* Either devices are locked, or hal_slice_restart() follows before the level opens: it repairs the software interrupt if
 * another interrupt comes in between. */
static HAL_INLINE void hal_slice_unforce(void)
{
    cpu_forced = false;
    if (cpu_slice_ms != 0) {
        REGISTER(CLINT_MSIP) = 0;
    }
}

#endif
