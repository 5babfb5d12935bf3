/* SPDX-License-Identifier: MIT */
/* Proximity between frames: all emitters are on for three scans; the reading of the last one less the background is the
 * reflection. proximity.c converts it into millimetres and an event; a program has this device or io/analog. */
#include "../analog/proximity.c"

#include "infrared_parts.h"

static uint16 lit_readings[HAL_INFRARED_SENSORS];

bool reflections_init(void)
{
    proximity_init();
    return Sys_Register_Event(SYS_IO_PROXIMITY);
}

void reflections_lit(scan raw)
{
    for (uint8 i = 0; i < HAL_INFRARED_SENSORS; i++) {
        lit_readings[i] = (uint16)raw[i];
    }
}

void reflections_use(void)
{
    for (uint8 i = 0; i < HAL_INFRARED_SENSORS; i++) {
        proximity_measured(i, detector_background(i) / 16, false);
        proximity_measured(i, lit_readings[i], true);
    }
    proximity_send();
}
