/* SPDX-License-Identifier: MIT */
/* Analog devices: proximity, accelerometer, microphones. Each passes its measurements to a pre-processor before it
 * sends an event. A program can exchange the pre-processor; NULL restores the default. Contract lines: openswarm.h. */
#ifndef ANALOG_H
#define ANALOG_H

#include "openswarm.h"

enum {
    SYS_IO_PROXIMITY = 0x11,    /* [uint8 mm of sensors 0-7, SYS_OUT_OF_RANGE = no object near], every 50 ms */
    SYS_IO_ACCELERATION = 0x12, /* [sys_acceleration], every 50 ms */
    SYS_IO_SOUND = 0x13,        /* [uint16 loudness of microphones 0-2], every 50 ms */
    SYS_PROXIMITY_SENSORS = 8,
    SYS_MICROPHONES = 3,
    SYS_ANALOG_SCANS = 64, /* in 50 ms */
    SYS_OUT_OF_RANGE = 0xFF
};

typedef struct {
    sint16 x, y, z; /* right, backward, up; 800 counts per g */
} sys_acceleration;

/* Converts a reflection without ambient light into 0-100 mm or SYS_OUT_OF_RANGE. ISR context. */
typedef uint8 (*sys_proximity_processor)(uint8 sensor, uint16 reflection);
uint8 Sys_Default_ProximityProcessor(uint8 sensor, uint16 reflection);
/* MTHI | no | 9 | 4 | none. */
sys_proximity_processor Sys_Set_ProximityProcessor(sys_proximity_processor processor);

/* Receives the mean of SYS_ANALOG_SCANS measurements and may change it; true: it is sent as SYS_IO_ACCELERATION. ISR
 * context. The default sends every mean. */
typedef bool (*sys_acceleration_processor)(sys_acceleration *mean);
/* MTHI | no | 6 | 4 | none. */
sys_acceleration_processor Sys_Set_AccelerationProcessor(sys_acceleration_processor processor);

/* Receives each sample of a microphone, around 0, and that microphone's accumulated value, initially 0; returns the new
 * value, which the next event reports. ISR context, 3,840 times a second. */
typedef uint16 (*sys_sound_processor)(uint8 microphone, sint16 sample, uint16 so_far);
uint16 Sys_Default_SoundProcessor(uint8 microphone, sint16 sample, uint16 so_far); /* the largest amplitude */
/* MTHI | no | 9 | 4 | none. */
sys_sound_processor Sys_Set_SoundProcessor(sys_sound_processor processor);

/* M | no | - | 40 | MEMORY.  Between Sys_Init_Kernel and Sys_Start_Kernel. */
bool Sys_Start_Analog(void);

/* MTHI | no | 9 | 4 | none.  sensor 0-7. Counts of the 12-bit converter; the two of a pair are measured every 6.25 ms.
 * A larger reflection is nearer, a smaller ambient light is brighter. */
uint16 Sys_Get_Reflection(uint8 sensor);
uint16 Sys_Get_AmbientLight(uint8 sensor);
/* MTHI | no | 17 | 4 | none. */
sys_acceleration Sys_Get_Acceleration(void);
/* MTHI | no | 29 | 4 | none.  microphone 0-2: right, left, back; around 0; 1,280 values/s. */
sint16 Sys_Get_Sound(uint8 microphone);

#endif
