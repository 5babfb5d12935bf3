/* Proximity, accelerometer and microphones from one stream of scans: the emitters of one pair of sensors are dark in one
 * scan and lit in the next, so the difference is free of ambient light. */
#include "analog.h"

#include "hal_analog.h"
#include "kernel.h"

enum { ZERO = 2048 /* counts at rest (epuck.md §6) */, ROUNDS_PER_EVENT = 8, PAIRS = SYS_PROXIMITY_SENSORS / 2 };

/* White surface (epuck.md §5, column OpenSwarm): counts at 0, 10, ... 100 mm. */
enum { TABLE_STEP_MM = 10, TABLE_LAST = 10 };
static const uint16 table[TABLE_LAST + 1] = {3788, 3548, 857, 474, 296, 205, 153, 113, 84, 65, 53};

static sys_proximity_processor processor;
static uint16 ambient[SYS_PROXIMITY_SENSORS], reflection[SYS_PROXIMITY_SENSORS];
static uint8 millimetres[SYS_PROXIMITY_SENSORS];
static uint16 latest[HAL_ANALOG_FIXED]; /* microphones, then axes */
static uint8 rounds;

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
    while (counts < table[row]) {
        row++;
    }
    uint16 behind = (uint16)((table[row - 1] - counts) * TABLE_STEP_MM / (table[row - 1] - table[row]));
    return (uint8)((row - 1) * TABLE_STEP_MM + behind);
}

static void measured(uint8 sensor, uint16 raw, bool lit)
{
    if (!lit) {
        ambient[sensor] = raw;
    } else {
        reflection[sensor] = raw < ambient[sensor] ? (uint16)(ambient[sensor] - raw) : 0;
        millimetres[sensor] = processor(sensor, reflection[sensor]);
    }
}

void analog_scanned(const hal_analog_scan *scan)
{
    for (uint8 i = 0; i < HAL_ANALOG_FIXED; i++) {
        latest[i] = scan->fixed[i];
    }
    measured(scan->pair, scan->near[0], scan->lit);
    measured((uint8)(scan->pair + PAIRS), scan->near[1], scan->lit);
    if (scan->lit && scan->pair == PAIRS - 1 && ++rounds == ROUNDS_PER_EVENT) {
        rounds = 0;
        (void)Sys_Send_Event(SYS_IO_PROXIMITY, millimetres, sizeof millimetres);
    }
}

bool Sys_Start_Analog(void)
{
    processor = Sys_Default_ProximityProcessor;
    rounds = 0;
    hal_analog_start();
    return Sys_Register_Event(SYS_IO_PROXIMITY);
}

sys_proximity_processor Sys_Set_ProximityProcessor(sys_proximity_processor wanted)
{
    sys_proximity_processor before = processor;
    processor = wanted != NULL ? wanted : Sys_Default_ProximityProcessor;
    return before;
}

uint16 Sys_Get_Reflection(uint8 sensor)
{
    return reflection[sensor % SYS_PROXIMITY_SENSORS];
}

uint16 Sys_Get_AmbientLight(uint8 sensor)
{
    return ambient[sensor % SYS_PROXIMITY_SENSORS];
}

sys_acceleration Sys_Get_Acceleration(void)
{
    hal_lock_state lock = hal_lock_devices();
    sys_acceleration a = {(sint16)(latest[SYS_MICROPHONES] - ZERO), (sint16)(latest[SYS_MICROPHONES + 1] - ZERO),
                          (sint16)(latest[SYS_MICROPHONES + 2] - ZERO)};
    hal_unlock(lock);
    return a;
}

sint16 Sys_Get_Sound(uint8 microphone)
{
    return (sint16)(latest[microphone % SYS_MICROPHONES] - ZERO);
}
