/* SPDX-License-Identifier: MIT */
/* AVR: the level is two bits. "Open", in GPIOR0, permits thread switches. The slice interrupt and device interrupts
 * test it before a switch and set "due" if it is clear; "over" means that the slice has expired. I, in SREG: clear =
 * level device. SBI and CBI change GPIOR0 in one instruction each, so its bits need no lock. */
#ifndef HAL_PORT_H
#define HAL_PORT_H

#include <avr/io.h>

#undef HAL_INLINE
#undef HAL_OUTLINE
#define HAL_INLINE inline /* flash is scarcer than cycles, so the compiler decides */
#define HAL_OUTLINE
#undef HAL_ZEROS
#define HAL_ZEROS const /* the compiler folds the zeros into the readers and removes the object */
#define HAL_STACK_GROWS_DOWN
#define HAL_WORD_IS_ONE_ACT 0

/* SREG; the high byte is "open" for a slice lock that the matching unlock ends. The compiler knows that the high
 * byte of a device lock is 0, and omits it. */
typedef uint16_t hal_lock_state;
typedef uint8_t *hal_limit;     /* lowest byte of the stack */

enum { CPU_WAS_OPEN = 1 << 8, CPU_OPEN = 1 << 0, CPU_DUE = 1 << 1, CPU_OVER = 1 << 3, CPU_FORCED = 1 << 4, CPU_I = 1 << SREG_I }; /* switch.S repeats the values */

#define HAL_THREAD_LEVEL (CPU_WAS_OPEN | CPU_I)

void cpu_open(void); /* leaves level slice; takes a slice end that became due meanwhile */

static inline __attribute__((always_inline)) hal_lock_state hal_lock_slice(void)
{
    hal_lock_state before = (hal_lock_state)(SREG | (uint16_t)(GPIOR0 & CPU_OPEN) << 8);
    GPIOR0 &= (uint8_t)~CPU_OPEN;
    hal_barrier();
    return before;
}

static inline __attribute__((always_inline)) hal_lock_state hal_lock_devices(void)
{
    hal_lock_state before = SREG;
    __asm__ volatile("cli" ::: "memory");
    return before;
}

static inline __attribute__((always_inline)) void hal_unlock(hal_lock_state before)
{
    hal_barrier();
    if (before & CPU_WAS_OPEN) { /* never true after hal_lock_devices(), where the compiler omits it */
        cpu_open();
    } else {
        SREG = (uint8_t)before;
    }
}

static inline __attribute__((always_inline)) bool hal_in_isr(void)
{
    return !(SREG & CPU_I);
}

static inline __attribute__((always_inline)) bool hal_in_thread(void)
{
    if (!(GPIOR0 & CPU_OPEN)) {
        return false;
    }
    return !hal_in_isr();
}

static inline __attribute__((always_inline)) void hal_slice_restart(uint16_t spent)
{
    TCNT0 = (uint8_t)spent;
    TIFR0 = 1 << OCF0A;
    GPIOR0 &= (uint8_t)~CPU_DUE;
    GPIOR0 &= (uint8_t)~CPU_OVER;
    if (GPIOR0 & CPU_FORCED) {
        GPIOR0 |= CPU_DUE;
    }
}

/* Not up to the last count: a compare match right after a store of TCNT0 would be missed. */
static inline __attribute__((always_inline)) uint16_t hal_slice_spent(void)
{
    uint8_t spent = TCNT0, most = (uint8_t)(OCR0A - 2u);
    return spent < most ? spent : most;
}

static inline __attribute__((always_inline)) bool hal_slice_is_over(void)
{
    return GPIOR0 & CPU_OVER;
}

static inline __attribute__((always_inline)) void hal_slice_force(void)
{
    GPIOR0 |= CPU_FORCED;
    GPIOR0 |= CPU_DUE;
}

/* Either devices are locked, or hal_slice_restart() follows before the level opens: it repairs "due" if an interrupt comes
 * between two of these instructions. */
static inline __attribute__((always_inline)) void hal_slice_unforce(void)
{
    GPIOR0 &= (uint8_t)~CPU_FORCED;
    if (!(GPIOR0 & CPU_OVER)) {
        GPIOR0 &= (uint8_t)~CPU_DUE;
    }
}

#endif
