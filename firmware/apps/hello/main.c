/* The smallest OpenSwarm program: one thread that greets on UART1 every second. The work is in greeting.c. */
#include <openswarm.h>

#include "greeting.h"

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Process(greet) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
