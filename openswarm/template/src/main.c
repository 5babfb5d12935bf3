/* @PROJECT@: one thread greets on UART1, another sends a beat; its handler toggles the body LED. */
#include <openswarm.h>
#include <openswarm_io.h>

enum { EVENT_BEAT = SYS_FIRST_USER_EVENT }; /* [uint16 number of the beat] */

static void greet(void)
{
    static const char text[] = "hello from @PROJECT@\r\n";
    for (;;) {
        Sys_Send_Event(SYS_SEND_UART1, text, sizeof text - 1);
        Sys_Sleep(1000);
    }
}

static void beat(void)
{
    for (uint16 number = 0;; number++) {
        Sys_Send_IntEvent(EVENT_BEAT, number);
        Sys_Sleep(1000);
    }
}

static bool on_beat(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    Sys_Set_LED(SYS_LED_BODY, data->value % 2 == 0);
    return true;
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Register_Event(EVENT_BEAT));
    SYS_ASSERT(Sys_Subscribe_to_Event(EVENT_BEAT, 0, on_beat, NULL));
    SYS_ASSERT(Sys_Start_Process(greet) != 0);
    SYS_ASSERT(Sys_Start_Process(beat) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
