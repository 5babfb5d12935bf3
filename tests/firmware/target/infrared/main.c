/* With selector 15 the robot sends infra-red frames without pause while the camera captures. With other selectors a
 * turn of the selector is a shared event, which lights the body LED. */
#include <camera.h>
#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <openswarm_remote.h>

enum { TURNED = SYS_FIRST_USER_EVENT, HOPS = 3, BUSY = 15 };

static void talk(void)
{
    for (;;) {
        Sys_Send_Neighbours("\x00\xFF\x55\xAA\x00\x00\xFF\xFF", SYS_MESSAGE_BYTES);
        Sys_Sleep(40);
    }
}

static bool on_selector(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    return Sys_Send_IntEvent(TURNED, data->value);
}

static bool on_turned(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    return Sys_Set_LED(SYS_LED_BODY, data->value != 0);
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared());
    SYS_ASSERT(Sys_Register_Event(TURNED) && Sys_Share_Event(TURNED, HOPS));
    SYS_ASSERT(Sys_Subscribe_to_Event(TURNED, 0, on_turned, NULL));
    SYS_ASSERT(Sys_Subscribe_to_Event(SYS_IO_SELECTOR, 0, on_selector, NULL));
    if (Sys_Get_Selector() == BUSY) {
        SYS_ASSERT(Sys_Start_Camera());
        SYS_ASSERT(Sys_Start_Process(talk) != 0);
    }
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
