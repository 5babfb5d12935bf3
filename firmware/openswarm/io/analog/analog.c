/* SPDX-License-Identifier: MIT */
/* Proximity, accelerometer and microphones from one stream of scans. The emitters of one pair of sensors are off in one
 * scan and on in the next, so that the difference contains no ambient light. */
#include "analog_parts.h"

#include "hal_analog.h"
#include "kernel.h"

enum { PAIRS = SYS_PROXIMITY_SENSORS / 2 };

static uint8 scans;

void analog_scanned(const hal_analog_scan *scan)
{
    sound_measured(scan->fixed);
    motion_measured(scan->fixed + SYS_MICROPHONES);
    proximity_measured(scan->pair, scan->near[0], scan->lit);
    proximity_measured((uint8)(scan->pair + PAIRS), scan->near[1], scan->lit);
    if (++scans == SYS_ANALOG_SCANS) {
        scans = 0;
        proximity_send();
        motion_send();
        sound_send();
    }
}

bool Sys_Start_Analog(void)
{
    scans = 0;
    proximity_init();
    motion_init();
    sound_init();
    hal_analog_start();
    bool proximity = Sys_Register_Event(SYS_IO_PROXIMITY);
    bool motion = Sys_Register_Event(SYS_IO_ACCELERATION);
    return Sys_Register_Event(SYS_IO_SOUND) && proximity && motion;
}
