/* SPDX-License-Identifier: MIT */
/* Cortex-M: what option/reset.c needs (docs/porting.md). The flags of the reset belong to the chip: RCC_CSR of the
 * STM32F4 (RM0090, 7.3.21). */
#ifndef HAL_RESET_H
#define HAL_RESET_H

#include "openswarm_reset.h"

#define HAL_PERSISTENT __attribute__((section(".noinit")))
#define HAL_RCC_CSR (*(volatile uint32_t *)0x40023874u)

static inline uint8_t hal_reset_cause(void)
{
    uint32_t flags = HAL_RCC_CSR;
    HAL_RCC_CSR = 1u << 24; /* RMVF */
    return flags & 1u << 27   ? SYS_RESET_POWER
           : flags & 1u << 25 ? SYS_RESET_BROWN_OUT
           : flags & 3u << 29 ? SYS_RESET_WATCHDOG
           : flags & 1u << 28 ? SYS_RESET_SOFTWARE
           : flags & 1u << 26 ? SYS_RESET_PIN
                              : SYS_RESET_POWER;
}

#endif
