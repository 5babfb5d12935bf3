/* SPDX-License-Identifier: MIT */
/* Lower layer of the camera: start, and the callback of the interrupt at IPL 4. */
#ifndef HAL_CAMERA_H
#define HAL_CAMERA_H

#include "camera_sensor.h"

camera_type hal_camera_init(void);
void camera_frame_complete(void); /* ISR, io/camera */

#endif
