/* SPDX-License-Identifier: MIT */
/* Battery (battery.h). */
#include "battery.h"

#include "hal_battery.h"

bool Sys_Is_BatteryLow(void)
{
    return hal_battery_is_low();
}
