/* SPDX-License-Identifier: MIT */
/* dsPIC30F: what option/reset.c and option/watchdog.c need (docs/porting.md). */
#ifndef HAL_RESET_H
#define HAL_RESET_H

#include "hal_cpu.h"
#include "openswarm_reset.h"

#define HAL_PERSISTENT __attribute__((persistent))
#define HAL_WATCHDOG_MS 128 /* of the board's configuration word: 2 ms, prescalers 8 and 8 */

/* Reads and clears the flags of RCON (isa.md §14.6). */
static inline uint8_t hal_reset_cause(void)
{
    enum { POR = 1 << 0, BOR = 1 << 1, WDTO = 1 << 4, SWR = 1 << 6, EXTR = 1 << 7, TRAPS = 3 << 14 };
    uint16_t flags = RCON;
    RCON = flags & (uint16_t)~(POR | BOR | WDTO | SWR | EXTR | (uint16_t)TRAPS);
    return (uint8_t)(flags & POR               ? SYS_RESET_POWER
                     : flags & BOR             ? SYS_RESET_BROWN_OUT
                     : flags & (uint16_t)TRAPS ? SYS_RESET_TRAP
                     : flags & WDTO            ? SYS_RESET_WATCHDOG
                     : flags & SWR             ? SYS_RESET_SOFTWARE
                                               : SYS_RESET_PIN);
}

#define hal_watchdog_start() ((void)(RCONbits.SWDTEN = 1))
#define hal_watchdog_clear() __asm__ volatile("clrwdt")

#endif
