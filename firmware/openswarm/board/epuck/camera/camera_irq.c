/* The camera's interrupt into the kernel: OC8, a vector nobody else uses, at IPL 4 (kernel.md §4). */
#include "hal_camera.h"
#include "i2c_master.h"
#include "kernel.h"

enum { PRIORITY = 4 };

HAL_USED void camera_frame_isr(void)
{
    IFS2bits.OC8IF = 0;
    camera_frame_complete();
}

camera_type hal_camera_init(void)
{
    i2c_init();
    camera_type type = camera_sensor_init();
    if (type != CAMERA_NONE) {
        camera_capture_init();
        IPC8bits.OC8IP = PRIORITY;
        IFS2bits.OC8IF = 0;
        IEC2bits.OC8IE = 1;
    }
    return type;
}
