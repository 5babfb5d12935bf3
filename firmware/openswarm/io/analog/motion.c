/* SPDX-License-Identifier: MIT */
/* Accelerometer: the last measurement on call, means as events. */
#include "analog_parts.h"
#include "kernel.h"

#include <string.h>

enum { AXES = 3 };

static sys_acceleration_processor processor; /* NULL: every mean is sent unchanged */
static uint16 latest[AXES];
static uint32 sums[AXES];

void motion_init(void)
{
    processor = NULL;
    memset(sums, 0, sizeof sums);
}

void motion_measured(const uint16 *axes)
{
    for (uint8 axis = 0; axis < AXES; axis++) {
        latest[axis] = axes[axis];
        sums[axis] += axes[axis];
    }
}

static sys_acceleration centred(uint16 x, uint16 y, uint16 z)
{
    sys_acceleration a = {(sint16)(x - ANALOG_ZERO), (sint16)(y - ANALOG_ZERO), (sint16)(z - ANALOG_ZERO)};
    return a;
}

void motion_send(void)
{
    sys_acceleration mean =
        centred((uint16)(sums[0] / SYS_ANALOG_SCANS), (uint16)(sums[1] / SYS_ANALOG_SCANS), (uint16)(sums[2] / SYS_ANALOG_SCANS));
    memset(sums, 0, sizeof sums);
    if (processor == NULL || processor(&mean)) {
        (void)Sys_Send_Event(SYS_IO_ACCELERATION, &mean, sizeof mean);
    }
}

sys_acceleration_processor Sys_Set_AccelerationProcessor(sys_acceleration_processor wanted)
{
    sys_acceleration_processor before = processor;
    HAL_STORE(processor, wanted);
    return before;
}

sys_acceleration Sys_Get_Acceleration(void)
{
    hal_lock_state lock = hal_lock_devices();
    sys_acceleration a = centred(latest[0], latest[1], latest[2]);
    hal_unlock(lock);
    return a;
}
