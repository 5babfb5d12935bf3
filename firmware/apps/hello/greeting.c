#include "greeting.h"

#include <openswarm_io.h>

void greet(void)
{
    static const char text[] = "hello, swarm\r\n";
    for (;;) {
        Sys_Send_Event(SYS_SEND_UART1, text, sizeof text - 1);
        Sys_Toggle_LED(SYS_LED_BODY);
        Sys_Sleep(1000);
    }
}
