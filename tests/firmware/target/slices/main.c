/* Three threads that never yield, a slow handler, a handler that resends for ever, a storm of events and an echo of
 * UART1 input; the test observes the running thread from outside. */
#include <openswarm.h>
#include <p30F6014A.h>

enum { STORM = SYS_FIRST_USER_EVENT, STORM_PERIOD = 1474 /* 100 us */ };

volatile uint16 handled __attribute__((used)), stormed __attribute__((used));
volatile uint16 resent __attribute__((used)), echoed __attribute__((used));
volatile uint32 clock_events __attribute__((used));
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

/* About 40 Tcy a call, a hundred calls a slice: charged to the slice they would cost 4,000 of its 147,456 Tcy. */
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
    resent += Sys_Send_IntEvent(event, data->value); /* for ever */
    return true;
}

static bool echo(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    echoed += Sys_Send_Event(SYS_SEND_UART1, data->payload, data->size);
    return true;
}

static bool on_clock(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    clock_events++;
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
    Sys_Subscribe_to_Event(SYS_UART1_RECEIVED, 0, echo, NULL);
    Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, on_clock, NULL);
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
