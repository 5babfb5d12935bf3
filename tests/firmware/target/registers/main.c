/* Register patterns under preemption and an interrupt storm, for tests/firmware/kernel/test_kernel_on_target.py. */
#include <openswarm.h>
#include <p30F6014A.h>

enum { STORM = SYS_FIRST_USER_EVENT, STORM_PERIOD = 1474 /* 100 us */ };

volatile uint16 checked[4] __attribute__((used));
volatile uint16 broken __attribute__((used));
volatile uint16 stormed __attribute__((used)), handled __attribute__((used));
volatile uint16 pids[4] __attribute__((used));

extern void pattern_one(void *), pattern_two(void *), pattern_dsp_one(void *), pattern_dsp_two(void *);

static void start(uint16 i, void (*entry)(void *), uint16 flags)
{
    sys_process_config config = {0};
    config.entry = entry;
    config.flags = flags;
    config.stack = (flags & SYS_DSP) ? 192 : 0;
    pids[i] = Sys_Start_ProcessWith(&config);
}

static bool on_storm(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    handled++;
    return true;
}

__attribute__((used)) void storm_isr(void)
{
    IFS1bits.T4IF = 0;
    stormed += Sys_Send_IntEvent(STORM, stormed);
}

int main(void)
{
    Sys_Init_Kernel();
    Sys_Register_Event(STORM);
    Sys_Subscribe_to_Event(STORM, 0, on_storm, NULL);
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 100); /* the motor interrupt at IPL 5 takes part */
    start(0, pattern_one, 0);
    start(1, pattern_two, 0);
    start(2, pattern_dsp_one, SYS_DSP);
    start(3, pattern_dsp_two, SYS_DSP);
    PR4 = STORM_PERIOD - 1;
    IPC5bits.T4IP = 4;
    IEC1bits.T4IE = 1;
    Sys_Start_Kernel();
    T4CONbits.TON = 1;
    Sys_Run_SystemThread();
    return 0;
}
