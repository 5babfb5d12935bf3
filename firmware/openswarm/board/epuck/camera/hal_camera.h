/* SPDX-License-Identifier: MIT */
/* Camera of the e-puck under the kernel: what the interrupt at IPL 4 calls, and the start of all of it. */
#ifndef HAL_CAMERA_H
#define HAL_CAMERA_H

#include "camera_sensor.h"

camera_type hal_camera_init(void);
void camera_frame_complete(void); /* ISR, io/camera */

#endif
