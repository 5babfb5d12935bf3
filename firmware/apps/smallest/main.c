/* The kernel, one thread and one UART: the cost of the smallest useful robot program. This file replaces the board's
 * list of devices (app.mk). */
#include <openswarm.h>

#include "hal_board.h"
#include "io.h"

void board_init(void)
{
    uart_init(SYS_UART1);
}

void board_start(void)
{
    uart_start(SYS_UART1);
}

void board_tick(void)
{
    uart_tick();
}

void board_failsafe(void)
{
}

void board_report(const char *text)
{
    (void)text;
}

static void greet(void)
{
    static const char text[] = "hello, swarm\r\n";
    for (;;) {
        Sys_Send_Event(SYS_SEND_UART1, text, sizeof text - 1);
        Sys_Sleep(1000);
    }
}

int main(void)
{
    Sys_Init_Kernel();
    Sys_Start_Process(greet);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    for (;;) {
    }
}
