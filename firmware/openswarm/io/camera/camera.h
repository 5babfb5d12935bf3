/* SPDX-License-Identifier: MIT */
/* Camera device: frames, and an exchangeable pre-processor whose default is the one-pixel sensor. */
#ifndef CAMERA_H
#define CAMERA_H

#include "openswarm.h"

enum {
    SYS_IO_CAMERA = 0x10, /* [uint16 number of the frame] a frame is complete; the driver's own subscription comes first */
    SYS_CAMERA_WIDTH = 20,
    SYS_CAMERA_HEIGHT = 20
};

/* Receives a complete frame, 20 x 20 pixels RGB565, high byte first, and may set *colour; true: *colour is sent as
 * SYS_IO_1PXSENSOR. Handler context; the next capture starts after it returns. */
typedef bool (*sys_camera_processor)(const uint8 *frame, sys_colour *colour);

bool Sys_LineOfSight_Processor(const uint8 *frame, sys_colour *colour); /* the default: line_of_sight.h */
/* MTH | no | 55 | 16 | none. */
sys_camera_processor Sys_Set_CameraProcessor(sys_camera_processor processor);

/* M | 20 ms, polls the I2C bus | - | 60 | none.  Between Sys_Init_Kernel and Sys_Start_Kernel. False: no camera
 * answers; the program runs without its events. */
bool Sys_Start_Camera(void);
/* MTHI | no | 4 | 4 | none.  0 = none, 0x3030, 0x6030, 0x8030. */
uint16 Sys_Get_CameraType(void);
/* MTHI | no | 4 | 4 | none.  The capture buffer. */
const uint8 *Sys_Get_CameraFrame(void);

#endif
