/* Two threads; the second one makes the error that `mistake` selects after it is set. */
#include "openswarm.h"

volatile uint16 mistake;
int *volatile odd = (int *)0x3001;
int *volatile neighbour;

static __attribute__((noinline)) void store(int *where) { *where = 7; }

static void steady(void)
{
    int here = 0;
    neighbour = &here;
    for (;;) {
        Sys_Sleep(2);
    }
}

static void worker(void)
{
    for (;;) {
        Sys_Sleep(5);
        if (mistake == 1) {
            store(odd);
        } else if (mistake == 2) {
            store(neighbour);
        } else if (mistake == 3) {
            Sys_Assertion_Failed("main.c", 99);
        }
    }
}

int main(void)
{
    Sys_Init_Kernel();
    (void)Sys_Start_Process(steady);
    (void)Sys_Start_Process(worker);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
