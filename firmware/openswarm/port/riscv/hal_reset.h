/* SPDX-License-Identifier: MIT */
/* RISC-V: what option/reset.c needs (docs/porting.md). The architecture has no register that names the cause of a reset,
 * nor has QEMU's virt. */
#ifndef HAL_RESET_H
#define HAL_RESET_H

#include "openswarm_reset.h"

#define HAL_PERSISTENT __attribute__((section(".noinit")))

static inline uint8_t hal_reset_cause(void)
{
    return SYS_RESET_POWER;
}

#endif
