/* A scenario that uses every structural kernel call, repeated beside a thread that checks its registers. The test
 * interrupts it at every instruction (tests/firmware/kernel/test_kernel_on_target.py). */
#include <openswarm.h>
#include <p30F6014A.h>

enum { HEARD = SYS_FIRST_USER_EVENT, AWAITED, UNHEARD };

volatile uint16 heard __attribute__((used)), sent __attribute__((used)), woken __attribute__((used));
volatile uint16 isr_sent __attribute__((used)), failures __attribute__((used)), broken __attribute__((used));
volatile uint16 checked __attribute__((used)), heap_before __attribute__((used)), heap_after __attribute__((used));
volatile uint16 checker_pid __attribute__((used)), driver_pid __attribute__((used));

extern void pattern_checker(void);

static void expect(bool holds)
{
    failures += !holds;
}

static bool listener(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    heard += data->size == 2;
    return true;
}

__attribute__((used)) void points_isr(void)
{
    IFS1bits.INT1IF = 0;
    isr_sent += Sys_Send_IntEvent(HEARD, 3);
}

static void waiter(void)
{
    sys_event_data *data = Sys_Wait_for_Event(AWAITED);
    woken += data != NULL && data->value == 9;
    Sys_Clear_EventData(&data);
}

static void nobody(void)
{
    for (;;) {
        Sys_Yield();
    }
}

/* Defines a function at which the test stops. */
#define STOP(name)                                                    \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        __asm__ volatile("nop" ::: "memory");                         \
    }
STOP(scenario_begin)
STOP(scenario_end)

static void scenario(void)
{
    uint16 w = Sys_Start_Process(waiter);
    while (Sys_Get_ProcessState(w) != SYS_BLOCKED) {
        Sys_Yield();
    }
    expect(Sys_Register_Event(UNHEARD));
    expect(Sys_Subscribe_to_Event(UNHEARD, w, listener, NULL));
    sent += Sys_Send_IntEvent(HEARD, 1);
    expect(Sys_Send_IntEvent(AWAITED, 9));
    Sys_Start_CriticalSection();
    sent += Sys_Send_IntEvent(HEARD, 2);
    Sys_End_CriticalSection();
    Sys_Yield();
    uint16 n = Sys_Start_Process(nobody);
    Sys_Yield();
    expect(Sys_Kill_Process(n));
    expect(Sys_Unregister_Event(UNHEARD));
    while (Sys_Get_ProcessState(w) != SYS_UNKNOWN) {
        Sys_Yield();
    }
}

static void driver(void *unused)
{
    (void)unused;
    heap_before = Sys_Get_Statistics()->heap_used;
    for (;;) {
        scenario_begin();
        scenario();
        Sys_Yield(); /* delivers the last message of an interrupt */
        Sys_Yield();
        heap_after = Sys_Get_Statistics()->heap_used;
        scenario_end();
    }
}

int main(void)
{
    static const sys_process_config config = {driver, NULL, 192, 0, 0, 0, 0};
    Sys_Init_Kernel();
    Sys_Register_Event(HEARD);
    Sys_Register_Event(AWAITED);
    Sys_Subscribe_to_Event(HEARD, 0, listener, NULL);
    checker_pid = Sys_Start_Process(pattern_checker);
    driver_pid = Sys_Start_ProcessWith(&config);
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 100);
    IPC4bits.INT1IP = 4;
    IEC1bits.INT1IE = 1;
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}

/* Called by checker.S. */
__attribute__((used)) void checker_yield(void)
{
    Sys_Yield();
}
