/* SPDX-License-Identifier: MIT */
/* Start-up: initialises the parts of the kernel in order. Runs once per reset: variables start as zeros. */
#include "kernel.h"

void Sys_Init_Kernel(void)
{
    heap_init();
    event_init();
    process_init(); /* the caller becomes PID 0; interrupts stay disabled */
    (void)Sys_Register_Event(SYS_EVENT_TERMINATION);
    (void)Sys_Register_Event(SYS_1ms_TIMER);
    if (SYS_1PXSENSOR) {
        (void)Sys_Register_Event(SYS_IO_1PXSENSOR);
    }
    board_init();
}

void Sys_Start_Kernel(void)
{
    board_start();
    hal_start();
    section_start();
}
