/* Threads whose saved frames bench/kernel/rtos.py reads: one that is preempted and one that yields, each without and with DSP
 * state (SYS_DSP). */
#include <openswarm.h>

static void spin(void *unused)
{
    (void)unused;
    for (;;) {
        __asm__ volatile("nop" ::: "memory");
    }
}

static void yield(void *unused)
{
    (void)unused;
    for (;;) {
        Sys_Yield();
    }
}

int main(void)
{
    static const sys_process_config threads[] = {
        {spin, NULL, 0, 0, 0, 0, 0},
        {spin, NULL, 256, 0, SYS_DSP, 0, 0},
        {yield, NULL, 0, 0, 0, 0, 0},
        {yield, NULL, 256, 0, SYS_DSP, 0, 0},
    };
    Sys_Init_Kernel();
    for (uint16 i = 0; i < sizeof threads / sizeof threads[0]; i++) {
        (void)Sys_Start_ProcessWith(&threads[i]);
    }
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
