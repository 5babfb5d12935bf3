/* Three threads that never yield, a handler that takes long, and a storm; who runs when is watched from outside. */
#include <openswarm.h>
#include <p30F6014A.h>

enum { STORM = SYS_FIRST_USER_EVENT, STORM_PERIOD = 1474 /* 100 us */ };

volatile uint16 handled __attribute__((used)), stormed __attribute__((used));
volatile uint16 spins[3] __attribute__((used));

#define SPINNER(name, i)                                              \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        for (;;) {                                                    \
            spins[i]++;                                               \
        }                                                             \
    }
SPINNER(spin_a, 0)
SPINNER(spin_b, 1)
SPINNER(spin_c, 2)

/* About 40 Tcy a call, a hundred calls a slice: a slice that paid for them would lose 4,000 of its 147,456 Tcy. */
static bool on_storm(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    handled++;
    for (uint16 i = 0; i < 10; i++) {
        __asm__ volatile("nop");
    }
    return true;
}

__attribute__((used)) void storm_isr(void)
{
    IFS1bits.T4IF = 0;
    stormed += Sys_Send_IntEvent(STORM, stormed);
}

static bool resend(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    Sys_Send_IntEvent(event, data->value); /* for ever */
    return true;
}

int main(void)
{
    Sys_Init_Kernel();
    Sys_Register_Event(STORM);
    Sys_Subscribe_to_Event(STORM, 0, on_storm, NULL);
    Sys_Register_Event(STORM + 1);
    Sys_Subscribe_to_Event(STORM + 1, 0, resend, NULL);
    Sys_Send_IntEvent(STORM + 1, 1);
    Sys_Start_Process(spin_a);
    Sys_Start_Process(spin_b);
    Sys_Start_Process(spin_c);
    PR4 = STORM_PERIOD - 1;
    IPC5bits.T4IP = 4;
    IEC1bits.T4IE = 1;
    Sys_Start_Kernel();
    T4CONbits.TON = 1;
    Sys_Run_SystemThread();
    return 0;
}
