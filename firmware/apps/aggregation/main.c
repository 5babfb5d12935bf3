/* Aggregation without computation (README.md): one bit, whether another robot is ahead, chooses between two pairs
 * of wheel speeds. The remote control's OK starts, STANDBY and SLEEP stop. */
#include <camera.h>
#include <openswarm.h>
#include <openswarm_io.h>
#include <remote.h>

enum { KEY_STANDBY = 12, KEY_SLEEP = 42, KEY_OK = 53 }; /* RC-5 (openswarm-original.md §5.6) */
enum { SELECT_START = 8 }; /* selector bit: start without the remote control */

/* Percent of the greatest speed. Gauci et al., Int. J. Robotics Research 33 (2014): -70, -100 alone, 100, -100 with a
 * robot ahead. Others: DEFINES="-DALONE=-60,-90 -DAHEAD=80,-80". */
#ifndef ALONE
#define ALONE -70, -100
#endif
#ifndef AHEAD
#define AHEAD 100, -100
#endif
static const sint8 alone[2] = {ALONE}, ahead[2] = {AHEAD};
static bool running; /* the front LED shows it, the body LED a robot ahead */

static void drive(const sint8 *percent)
{
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)(percent[0] * SYS_MAXIMUM_SPEED / 100));
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)(percent[1] * SYS_MAXIMUM_SPEED / 100));
}

static bool react(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    if (running) {
        bool robot = (sys_colour)data->value == GREEN;
        Sys_Set_LED(SYS_LED_BODY, robot);
        drive(robot ? ahead : alone);
    }
    return true;
}

static void set_running(bool wanted)
{
    running = wanted;
    Sys_Set_LED(SYS_LED_FRONT, wanted);
}

static bool obey(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    if (data->value == KEY_OK) {
        set_running(true);
    } else if (data->value == KEY_STANDBY || data->value == KEY_SLEEP) {
        static const sint8 rest[2] = {0, 0};
        set_running(false);
        drive(rest);
    }
    return true;
}

int main(void)
{
    Sys_Init_Kernel();
    set_running((Sys_Get_Selector() & SELECT_START) != 0);
    Sys_Start_Camera();
    Sys_Start_Remote();
    Sys_Subscribe_to_Event(SYS_IO_REMOTECONTROL, 0, obey, NULL);
    Sys_Subscribe_to_Event(SYS_IO_1PXSENSOR, 0, react, NULL);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
