/* Robots that keep moving among each other: slow, turning away from what is near. For apps that show what messages do
 * between robots that move; they name this folder in INCLUDES. */
#ifndef ROVE_H
#define ROVE_H

#include <openswarm.h>
#include <openswarm_infrared.h>

/* mm/s, and mm at which a robot turns: chosen slow, so that neighbours stay for some messages, and short, since there are
 * robots all around. */
enum { ROVE_SPEED = 40, ROVE_NEAR_MM = 35 };

static void rove_drive(sint16 left, sint16 right)
{
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)left);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)right);
}

static bool rove_steer(uint16 pid, uint16 event, sys_event_data *data)
{
    enum { FRONT_RIGHT, RIGHT, LEFT = 6, FRONT_LEFT };
    static uint8 turning; /* looks, of 20 a second */
    static bool to_left;
    const uint8 *mm = data->payload;
    bool right = mm[FRONT_RIGHT] < ROVE_NEAR_MM || mm[RIGHT] < ROVE_NEAR_MM / 2;
    bool left = mm[FRONT_LEFT] < ROVE_NEAR_MM || mm[LEFT] < ROVE_NEAR_MM / 2;
    (void)pid;
    (void)event;
    if (right || left) {
        if (turning == 0) {
            to_left = right && (!left || (Sys_Get_RobotNumber() & 1u) != 0);
        }
        turning = 6;
    } else if (turning != 0) {
        turning--;
    }
    if (turning != 0) {
        rove_drive(to_left ? -ROVE_SPEED : ROVE_SPEED, to_left ? ROVE_SPEED : -ROVE_SPEED);
    } else {
        rove_drive(ROVE_SPEED, ROVE_SPEED);
    }
    return true;
}

static bool rove_begin(void)
{
    return Sys_Subscribe_to_Event(SYS_IO_PROXIMITY, 0, rove_steer, NULL);
}

#endif
