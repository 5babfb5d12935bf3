/* Robots that drive slowly among each other, turn away from near obstacles, and turn at random now and then. For apps
 * with messages between moving robots; they name this folder in INCLUDES. */
#ifndef ROVE_H
#define ROVE_H

#include <openswarm.h>
#include <openswarm_infrared.h>

/* mm/s, and distance in mm at which a robot turns: slow, so that neighbours stay in reach for some messages, and short,
 * because there are robots on all sides. */
enum { ROVE_SPEED = 40, ROVE_NEAR_MM = 35 };
enum {
    ROVE_STEP_MS = 50,
    ROVE_TURN = 6,      /* steps of a turn after the last near reading: 0.5 rad */
    ROVE_MOST_TURN = 40, /* steps, more than half a turn: then straight on despite obstacles */
    ROVE_STRAIGHT = 40, /* fewest steps before a random turn, the most are twice that */
    ROVE_STACK = 140
};

static volatile bool rove_near_right, rove_near_left; /* since the last step; while others send, readings are rare */

static bool rove_look(uint16 pid, uint16 event, sys_event_data *data)
{
    enum { FRONT_RIGHT, RIGHT, LEFT = 6, FRONT_LEFT };
    const uint8 *mm = data->payload;
    (void)pid;
    (void)event;
    rove_near_right = mm[FRONT_RIGHT] < ROVE_NEAR_MM || mm[RIGHT] < ROVE_NEAR_MM / 2;
    rove_near_left = mm[FRONT_LEFT] < ROVE_NEAR_MM || mm[LEFT] < ROVE_NEAR_MM / 2;
    return true;
}

static void rove_drive(sint16 left, sint16 right)
{
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)left);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)right);
}

static void rove(void *unused)
{
    uint16 random = 0;
    uint8 turning = 0, turned = 0, straight = ROVE_STRAIGHT; /* steps: left to turn, turned, until the next turn */
    bool to_left = false;
    (void)unused;
    for (;;) {
        bool right = rove_near_right, left = rove_near_left;
        rove_near_right = rove_near_left = false;
        random = (uint16)(random * 25173u + 13849u + Sys_Get_RobotNumber());
        if (straight-- == 0) {
            turning = (uint8)(ROVE_TURN + random / 256u % ROVE_STRAIGHT / 2u);
            to_left = (random & 0x8000u) != 0;
        } else if ((right || left) && turned < ROVE_MOST_TURN) {
            if (turning == 0) {
                to_left = right && (!left || (random & 0x8000u) != 0);
            }
            turning = ROVE_TURN;
        }
        if (turning != 0) {
            turning--;
            turned++;
            straight = (uint8)(ROVE_STRAIGHT + random / 256u % ROVE_STRAIGHT);
            rove_drive(to_left ? -ROVE_SPEED : ROVE_SPEED, to_left ? ROVE_SPEED : -ROVE_SPEED);
        } else {
            turned = turned > 2 ? (uint8)(turned - 2) : 0;
            rove_drive(ROVE_SPEED, ROVE_SPEED);
        }
        Sys_Sleep(ROVE_STEP_MS);
    }
}

static bool rove_begin(void)
{
    const sys_process_config driver = {.entry = rove, .stack = ROVE_STACK};
    return Sys_Subscribe_to_Event(SYS_IO_PROXIMITY, 0, rove_look, NULL) && Sys_Start_ProcessWith(&driver) != 0;
}

#endif
