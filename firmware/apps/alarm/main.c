/* x A shared event (README.md): a user turns one robot's selector, and all robots light up. Without the line marked below
 * this is a program for a single robot. */
#include <openswarm.h>
#include <openswarm_infrared.h>
#include <openswarm_io.h>
#include <openswarm_remote.h>

enum { ALARM = SYS_FIRST_USER_EVENT, HOPS = 3, LIT_MS = 1000 };

static bool on_selector(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    Sys_Send_IntEvent(ALARM, data->value);
    return true;
}

static void watch(void)
{
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(ALARM);
        Sys_Clear_EventData(&data);
        Sys_Set_LED(SYS_LED_BODY, true);
        Sys_Sleep(LIT_MS);
        Sys_Set_LED(SYS_LED_BODY, false);
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Infrared());
    SYS_ASSERT(Sys_Register_Event(ALARM));
    SYS_ASSERT(Sys_Share_Event(ALARM, HOPS)); /* from here on other robots receive the alarm, too */
    Sys_Subscribe_to_Event(SYS_IO_SELECTOR, 0, on_selector, NULL);
    SYS_ASSERT(Sys_Start_Process(watch) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
/* 1 */
/* 2 */
/* 3 */
/* x */
