/* SPDX-License-Identifier: MIT */
/* Battery: the comparator that goes low below 3.4 V (epuck.md §2). */
#ifndef BATTERY_H
#define BATTERY_H

#include "openswarm.h"

/* MTHI | no | 12 | 8 | none.  True: below 3.4 V; the motors should stop soon. */
bool Sys_Is_BatteryLow(void);

#endif
