/* Everything behind the analog converter: proximity, accelerometer, microphones. */
#ifndef ANALOG_H
#define ANALOG_H

#include "openswarm.h"

enum {
    SYS_IO_PROXIMITY = 0x11, /* [uint8 mm of sensors 0-7, SYS_OUT_OF_RANGE = nothing near], every 50 ms */
    SYS_PROXIMITY_SENSORS = 8,
    SYS_MICROPHONES = 3,
    SYS_OUT_OF_RANGE = 0xFF
};

typedef struct {
    sint16 x, y, z; /* right, backward, up; 800 counts per g */
} sys_acceleration;

/* Turns a reflection, ambient light already taken off, into mm 0-100 or SYS_OUT_OF_RANGE. ISR context. */
typedef uint8 (*sys_proximity_processor)(uint8 sensor, uint16 reflection);
uint8 Sys_Default_ProximityProcessor(uint8 sensor, uint16 reflection);
sys_proximity_processor Sys_Set_ProximityProcessor(sys_proximity_processor processor); /* MTHI; NULL: default */

/* M | no | - | 40 | MEMORY.  Between Sys_Init_Kernel and Sys_Start_Kernel. */
bool Sys_Start_Analog(void);

/* MTHI | no | 10 | 4.  sensor 0-7. Counts of the 12-bit converter; the two of a pair are measured every 6.25 ms. */
uint16 Sys_Get_Reflection(uint8 sensor); /* larger is nearer */
uint16 Sys_Get_AmbientLight(uint8 sensor); /* smaller is brighter */
sys_acceleration Sys_Get_Acceleration(void);
sint16 Sys_Get_Sound(uint8 microphone); /* 0-2: right, left, back; around 0; 1,280 values/s */

#endif
