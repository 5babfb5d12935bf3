/* SPDX-License-Identifier: MIT */
/* Proximity: reflections without ambient light, as distances. */
#include "analog_parts.h"
#include "hal_cpu.h"

/* White surface (epuck.md §5, column OpenSwarm): counts at 0, 5, ... 100 mm. The points between those of the table are
 * geometric means, as the section recommends; in between linear, which is off by less than half a millimetre. */
enum { TABLE_STEP_MM = 5, TABLE_LAST = 20 };
static const uint16 table[TABLE_LAST + 1] = {3788, 3666, 3548, 1744, 857, 637, 474, 375, 296, 246, 205,
                                             177,  153,  131,  113,  97,  84,  74,  65,  59,  53};

static sys_proximity_processor processor;
static uint16 ambient[SYS_PROXIMITY_SENSORS], reflection[SYS_PROXIMITY_SENSORS];
static uint8 millimetres[SYS_PROXIMITY_SENSORS];

uint8 Sys_Default_ProximityProcessor(uint8 sensor, uint16 counts)
{
    (void)sensor;
    if (counts < table[TABLE_LAST]) {
        return SYS_OUT_OF_RANGE;
    }
    if (counts >= table[0]) {
        return 0;
    }
    uint8 row = 1;
    LOOP_BOUND(19); /* TABLE_LAST - 1; not BOUNDS_AT: reflections.c includes this file */
    while (counts < table[row]) {
        row++;
    }
    uint16 span = (uint16)(table[row - 1] - table[row]);
    uint16 behind = (uint16)(((table[row - 1] - counts) * TABLE_STEP_MM + span / 2) / span);
    return (uint8)((row - 1) * TABLE_STEP_MM + behind);
}

void proximity_init(void)
{
    processor = Sys_Default_ProximityProcessor;
}

void proximity_measured(uint8 sensor, uint16 raw, bool lit)
{
    if (!lit) {
        ambient[sensor] = raw;
    } else {
        reflection[sensor] = raw < ambient[sensor] ? (uint16)(ambient[sensor] - raw) : 0;
        CALL_TARGETS(sys_proximity_processor);
        millimetres[sensor] = processor(sensor, reflection[sensor]);
    }
}

void proximity_send(void)
{
    (void)Sys_Send_Event(SYS_IO_PROXIMITY, millimetres, sizeof millimetres);
}

sys_proximity_processor Sys_Set_ProximityProcessor(sys_proximity_processor wanted)
{
    sys_proximity_processor before = processor;
    HAL_STORE(processor, wanted != NULL ? wanted : Sys_Default_ProximityProcessor);
    return before;
}

uint16 Sys_Get_Reflection(uint8 sensor)
{
    return HAL_LOAD(reflection[sensor % SYS_PROXIMITY_SENSORS]);
}

uint16 Sys_Get_AmbientLight(uint8 sensor)
{
    return HAL_LOAD(ambient[sensor % SYS_PROXIMITY_SENSORS]);
}
