/* SPDX-License-Identifier: MIT */
/* BATT_LOW on RF1: 1 = ok (epuck.md §2). */
#include "hal_battery.h"
#include "pins.h"

enum { BATTERY_OK = 0x0002 };

bool hal_battery_is_low(void)
{
    return (PORTF & BATTERY_OK) == 0;
}
