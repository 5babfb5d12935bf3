/* SPDX-License-Identifier: MIT */
/* Interrupt from the camera's capture into the kernel: OC8, an otherwise unused vector, at IPL 4 (kernel.md §4). */
#include "hal_camera.h"
#include "i2c_master.h"
#include "openswarm_interrupt.h"

SYS_INTERRUPT(OC8, 4, camera_frame_complete)

camera_type hal_camera_init(void)
{
    i2c_init();
    camera_type type = camera_sensor_init();
    if (type != CAMERA_NONE) {
        camera_capture_init();
        Sys_Enable_Interrupt(OC8);
    }
    return type;
}
