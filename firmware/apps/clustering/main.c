/* Object clustering without computation (README.md): each colour of the line-of-sight sensor selects a pair of wheel
 * speeds. The remote control's OK starts, STANDBY and SLEEP stop. */
#include <camera.h>
#include <openswarm.h>
#include <openswarm_io.h>
#include <remote.h>

#include "controller.h"

static const clustering_controller controllers[2] = {CONTROLLER_A, CONTROLLER_B};
static const clustering_controller *controller;
static bool running; /* the front LED shows it */

static void drive(wheel_speeds speeds)
{
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, speeds.left);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, speeds.right);
}

static bool react(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    if (!running) {
        return true;
    }
    switch ((sys_colour)data->value) {
    case GREEN:
        drive(controller->robot);
        break;
    case RED:
        drive(controller->object);
        break;
    case WHITE:
        drive(controller->nothing);
        break;
    default: /* keep the speed */
        break;
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
    static const wheel_speeds rest = {0, 0};
    (void)pid;
    (void)event;
    switch (data->value) {
    case KEY_OK:
        set_running(true);
        break;
    case KEY_STANDBY:
    case KEY_SLEEP:
        set_running(false);
        drive(rest);
        break;
    default:
        break;
    }
    return true;
}

int main(void)
{
    Sys_Init_Kernel();
    uint8 selector = Sys_Get_Selector();
    controller = &controllers[selector & SELECT_B];
    set_running(CLUSTERING_START_AT_ONCE || (selector & SELECT_START) != 0);
    Sys_Start_Camera();
    Sys_Start_Remote();
    SYS_ASSERT(Sys_Subscribe_to_Event(SYS_IO_REMOTECONTROL, 0, obey, NULL));
    SYS_ASSERT(Sys_Subscribe_to_Event(SYS_IO_1PXSENSOR, 0, react, NULL));
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
