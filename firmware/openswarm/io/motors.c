/* SPDX-License-Identifier: MIT */
/* Motors: speed events through a replaceable post-processor to the stepper driver. */
#include "io.h"
#include "kernel.h"

static sys_motor_processor processor;
static sys_wheel_speeds speeds;

bool Sys_Default_MotorProcessor(uint16 event, const sys_event_data *data, sys_wheel_speeds *wanted)
{
    if (event == SYS_LEFTMOTOR_SPEED) {
        wanted->left = (sint16)data->value;
    } else if (event == SYS_RIGHTMOTOR_SPEED) {
        wanted->right = (sint16)data->value;
    }
    return event == SYS_LEFTMOTOR_SPEED || event == SYS_RIGHTMOTOR_SPEED;
}

/* Clamps a speed to the maximum and then sets the last error; the getters return the clamped speed. */
static sint16 clamp(sint16 mm_s)
{
    if (mm_s >= -SYS_MAXIMUM_SPEED && mm_s <= SYS_MAXIMUM_SPEED) {
        return mm_s;
    }
    (void)os_fail(SYS_ERROR_ARGUMENT);
    return mm_s < 0 ? -SYS_MAXIMUM_SPEED : SYS_MAXIMUM_SPEED;
}

/* Messages are applied in the order they were sent, so the newest one wins. */
BOUNDS_AT("processor(event", calls sys_motor_processor);
static bool on_speed(uint16 pid, uint16 event, sys_event_data *data)
{
    sys_wheel_speeds wanted = speeds;
    (void)pid;
    if (processor(event, data, &wanted)) {
        HAL_STORE(speeds.left, clamp(wanted.left)); /* read by ISRs */
        HAL_STORE(speeds.right, clamp(wanted.right));
        hal_motors_drive(speeds.left, speeds.right);
    }
    return true;
}

bool Sys_Connect_Motors(uint16 event)
{
    return event_connect(event, on_speed);
}

sys_motor_processor Sys_Set_MotorProcessor(sys_motor_processor wanted)
{
    if (os_enter() != SYS_OK) {
        return NULL;
    }
    sys_motor_processor before = processor;
    processor = wanted != NULL ? wanted : Sys_Default_MotorProcessor;
    section_close();
    return before;
}

void motors_init(void)
{
    processor = Sys_Default_MotorProcessor;
    hal_motors_init();
    (void)Sys_Register_Event(SYS_LEFTMOTOR_SPEED);
    (void)Sys_Register_Event(SYS_RIGHTMOTOR_SPEED);
    (void)Sys_Connect_Motors(SYS_LEFTMOTOR_SPEED);
    (void)Sys_Connect_Motors(SYS_RIGHTMOTOR_SPEED);
}

void motors_stop(void)
{
    speeds.left = 0;
    speeds.right = 0;
    hal_motors_drive(0, 0);
}

sint16 Sys_Get_MotorSpeed_Left(void)
{
    return speeds.left;
}

sint16 Sys_Get_MotorSpeed_Right(void)
{
    return speeds.right;
}
