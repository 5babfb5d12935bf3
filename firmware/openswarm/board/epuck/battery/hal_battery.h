/* SPDX-License-Identifier: MIT */
/* Lower layer of the battery's comparator. */
#ifndef HAL_BATTERY_H
#define HAL_BATTERY_H

#include <stdbool.h>

bool hal_battery_is_low(void);

#endif
