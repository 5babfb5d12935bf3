/* @PROJECT@: one thread greets on UART1 and toggles the body LED every second. */
#include <openswarm.h>
#include <openswarm_io.h>

static void greet(void)
{
    static const char text[] = "hello from @PROJECT@\r\n";
    for (;;) {
        Sys_Send_Event(SYS_SEND_UART1, text, sizeof text - 1);
        Sys_Toggle_LED(SYS_LED_BODY);
        Sys_Sleep(1000);
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Process(greet) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
