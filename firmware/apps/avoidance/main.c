/* Obstacle avoidance by infrared (README.md): each side's sensors slow the wheel of the other side (Braitenberg's
 * vehicle). It starts at once. */
#include <analog.h>
#include <openswarm.h>
#include <openswarm_io.h>

enum { CRUISE = 90, NEAR_MM = 50, SPIN = 70, BLOCKED = 60 };
enum { FRONT_RIGHT, RIGHT, FRONT_LEFT = 7, LEFT = 6 }; /* sensors, clockwise from the front (epuck.md §5) */

/* 0 far, NEAR_MM touching. */
static sint16 nearness(const uint8 *mm, uint8 sensor)
{
    return mm[sensor] < NEAR_MM ? (sint16)(NEAR_MM - mm[sensor]) : 0;
}

static void drive(sint16 left, sint16 right)
{
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)left);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)right);
}

static bool steer(uint16 pid, uint16 event, sys_event_data *data)
{
    static bool to_left; /* direction of the turn, kept while both sides are blocked */
    const uint8 *mm = data->payload;
    sint16 right = (sint16)(2 * nearness(mm, FRONT_RIGHT) + nearness(mm, RIGHT));
    sint16 left = (sint16)(2 * nearness(mm, FRONT_LEFT) + nearness(mm, LEFT));
    (void)pid;
    (void)event;
    Sys_Set_LED(SYS_LED_FRONT, left + right > 0);
    if (left + right > BLOCKED) {
        drive(to_left ? -SPIN : SPIN, to_left ? SPIN : -SPIN);
    } else {
        to_left = right >= left;
        drive((sint16)(CRUISE - 2 * right), (sint16)(CRUISE - 2 * left));
    }
    return true;
}

int main(void)
{
    Sys_Init_Kernel();
    Sys_Start_Analog();
    Sys_Subscribe_to_Event(SYS_IO_PROXIMITY, 0, steer, NULL);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
