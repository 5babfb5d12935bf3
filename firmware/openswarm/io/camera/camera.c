/* SPDX-License-Identifier: MIT */
/* Camera: the capture's interrupt announces a frame; a handler on the kernel stack processes it and starts the next. */
#include "camera.h"

#include "camera_sensor.h"
#include "hal_camera.h"
#include "kernel.h"
#include "line_of_sight.h"

static uint8 frame[CAMERA_FRAME_BYTES];
static uint16 frames;
static camera_type type;
static sys_camera_processor processor;

bool Sys_LineOfSight_Processor(const uint8 *pixels, sys_colour *colour)
{
    *colour = (sys_colour)line_of_sight(pixels);
    return true;
}

static bool on_frame(uint16 pid, uint16 event, sys_event_data *data)
{
    sys_colour colour = BLACK;
    (void)pid;
    (void)event;
    (void)data;
    if (processor(frame, &colour)) {
        (void)Sys_Send_IntEvent(SYS_IO_1PXSENSOR, (uint16)colour);
    }
    camera_capture_next(frame);
    return true;
}

/* If there is no memory for the event, this frame is skipped and the next one announced. */
void camera_frame_complete(void)
{
    frames++;
    if (!Sys_Send_IntEvent(SYS_IO_CAMERA, frames)) {
        camera_capture_next(frame);
    }
}

bool Sys_Start_Camera(void)
{
    processor = Sys_LineOfSight_Processor;
    (void)Sys_Register_Event(SYS_IO_1PXSENSOR);
    (void)Sys_Register_Event(SYS_IO_CAMERA);
    (void)event_connect(SYS_IO_CAMERA, on_frame);
    type = hal_camera_init();
    if (type == CAMERA_NONE) {
        return false;
    }
    camera_capture_next(frame);
    return true;
}

sys_camera_processor Sys_Set_CameraProcessor(sys_camera_processor wanted)
{
    if (os_enter() != SYS_OK) {
        return NULL;
    }
    sys_camera_processor before = processor;
    processor = wanted != NULL ? wanted : Sys_LineOfSight_Processor;
    section_close();
    return before;
}

uint16 Sys_Get_CameraType(void)
{
    return (uint16)type;
}

const uint8 *Sys_Get_CameraFrame(void)
{
    return frame;
}
