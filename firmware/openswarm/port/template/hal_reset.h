/* SPDX-License-Identifier: MIT */
/* A host: what option/reset.c needs (docs/porting.md). Every start is a power-on. */
#ifndef HAL_RESET_H
#define HAL_RESET_H

#include "openswarm_reset.h"

#define HAL_PERSISTENT

static inline uint8_t hal_reset_cause(void)
{
    return SYS_RESET_POWER;
}

#endif
