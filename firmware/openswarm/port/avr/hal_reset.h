/* SPDX-License-Identifier: MIT */
/* AVR: what option/reset.c needs (docs/porting.md). There is no watchdog driver: it would need start-up code in
 * every program, because after a watchdog reset the watchdog must be stopped within 15 ms. */
#ifndef HAL_RESET_H
#define HAL_RESET_H

#include "openswarm_reset.h"

#include <avr/io.h>

#define HAL_PERSISTENT __attribute__((section(".noinit")))

static inline uint8_t hal_reset_cause(void)
{
    uint8_t flags = MCUSR;
    MCUSR = 0;
    return flags & 1 << PORF    ? SYS_RESET_POWER
           : flags & 1 << BORF  ? SYS_RESET_BROWN_OUT
           : flags & 1 << WDRF  ? SYS_RESET_WATCHDOG
                                : SYS_RESET_PIN;
}

#endif
