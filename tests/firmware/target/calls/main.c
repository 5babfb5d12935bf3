/* Small scenes that make every kernel call and restore everything, while a second thread checks its registers. The
 * harness interrupts each scene at every instruction and lets each of its allocations fail
 * (tests/firmware/injection.py). */
#include "isr_calls.h"

#include <openswarm_io.h>
#include <p30F6014A.h>

volatile uint16 scene __attribute__((used)), heard __attribute__((used)), sent __attribute__((used));
volatile uint16 isr_sent __attribute__((used)), bytes __attribute__((used)), leaf __attribute__((used));
volatile uint16 failures __attribute__((used)), broken __attribute__((used)), checked __attribute__((used));
volatile uint16 checker_pid __attribute__((used));
uint16 driver_pid __attribute__((used));

extern void pattern_checker(void);

static void expect(bool holds)
{
    failures += !holds;
}

static bool listener(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    heard += data->size != 0;
    return true;
}

static bool once(uint16 pid, uint16 event, sys_event_data *data)
{
    return listener(pid, event, data) && false;
}

static bool on_byte(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    bytes += data->value == 'x' && data->size == 1;
    return true;
}

static bool is_nine(sys_event_data *data)
{
    return data->value == 9;
}

/* UART processor that makes a message of every byte, so that a received byte is delivered within the scene. */
uint16 each_byte(uint8 byte, uint8 *buffer, uint16 *used)
{
    buffer[0] = byte;
    *used = 0;
    return 1;
}

__attribute__((used)) void calls_isr(void)
{
    IFS1bits.INT1IF = 0;
    isr_sent += Sys_Send_IntEvent(HEARD, 3);
    isr_calls();
}

static void passes(void)
{
    Sys_Yield();
}

static void gone(uint16 pid)
{
    while (pid != 0 && Sys_Get_ProcessState(pid) != SYS_UNKNOWN) {
        Sys_Yield();
    }
}

static void forever(void)
{
    for (;;) {
        Sys_Yield();
    }
}

/* ---- Scenes ------------------------------------------------------------------------------------------------------ */

static void threads(void)
{
    uint16 p = Sys_Start_Process(forever);
    Sys_Yield();
    expect(p != 0 && Sys_Get_ProcessState(p) <= SYS_READY); /* SYS_NEW if the slice ended at its first instruction */
    expect(Sys_Get_UnusedStack(p) != 0);
    expect(Sys_Kill_Process(p));
    expect(!Sys_Kill_Process(p) && Sys_Get_LastError() == SYS_ERROR_PROCESS);
    gone(Sys_Start_Process(passes));
}

static void period(void *unused)
{
    (void)unused;
    (void)Sys_Wait_for_Period();
}

static void periodic(void)
{
    static const sys_process_config config = {period, NULL, 192, 1, SYS_PERIODIC | SYS_DSP, 1, 1};
    uint16 p = Sys_Start_ProcessWith(&config);
    expect(p != 0);
    Sys_Set_Scheduler(&sys_earliest_deadline);
    Sys_Yield();
    Sys_Set_Scheduler(&sys_fixed_priority);
    Sys_Yield();
    Sys_Set_Scheduler(&sys_round_robin);
    if (p != 0) {
        (void)Sys_Kill_Process(p); /* fails if a tick has let the thread end already */
    }
}

static void registration(void)
{
    expect(Sys_Register_Event(PASSING));
    expect(Sys_Register_Event(PASSING));
    expect(Sys_IsEventRegistered(PASSING));
    expect(Sys_Subscribe_to_Event(PASSING, driver_pid, listener, NULL));
    expect(Sys_Subscribe_to_Event(PASSING, driver_pid, listener, is_nine));
    expect(Sys_Subscribe_to_Event(PASSING, driver_pid, once, NULL));
    expect(Sys_Unsubscribe_Handler(PASSING, driver_pid, listener));
    expect(Sys_Unsubscribe_from_Event(PASSING, driver_pid));
    expect(Sys_Unregister_Event(PASSING));
    expect(!Sys_Unregister_Event(PASSING));
}

static void sending(void)
{
    static const uint8 many[24] = {1};
    sent += Sys_Send_IntEvent(HEARD, 1);
    sent += Sys_Send_Event(HEARD, many, sizeof many);
    expect(!Sys_Send_IntEvent(UNKNOWN, 1));
    bool listens = Sys_Subscribe_to_Event(AWAITED, driver_pid, once, NULL);
    expect(listens);
    sent += Sys_Send_Event(AWAITED, many, 1) && listens;
    Sys_Yield();
    expect(!Sys_Unsubscribe_Handler(AWAITED, driver_pid, once));
    (void)Sys_Unsubscribe_from_Event(AWAITED, driver_pid);
}

static void waits_for_nine(void)
{
    sys_event_data *data = Sys_Wait_for_Condition(AWAITED, is_nine);
    sent++;
    heard += data != NULL && data->value == 9;
    Sys_Clear_EventData(&data);
}

static void waiting(void)
{
    uint16 p = Sys_Start_Process(waits_for_nine);
    while (p != 0 && Sys_Get_ProcessState(p) != SYS_BLOCKED) {
        Sys_Yield();
    }
    expect(Sys_Send_IntEvent(AWAITED, 8));
    expect(Sys_Send_IntEvent(AWAITED, 9));
    Sys_Yield();
    (void)Sys_Kill_Process(p);
}

static void ends_waiting(void)
{
    sys_event_data *data = Sys_Wait_for_Event(PASSING);
    Sys_Clear_EventData(&data);
}

/* Unregisters an event for which a thread waits and a message is queued. */
static void unregistering(void)
{
    expect(Sys_Register_Event(PASSING));
    uint16 p = Sys_Start_Process(ends_waiting);
    Sys_Yield();
    Sys_Start_CriticalSection();
    expect(Sys_Subscribe_to_Event(PASSING, driver_pid, listener, NULL));
    expect(Sys_Send_IntEvent(PASSING, 1));
    expect(Sys_Unregister_Event(PASSING));
    Sys_End_CriticalSection();
    gone(p);
}

static void time_out(void)
{
    sys_event_data *data = Sys_Wait_for_ConditionTimeout(AWAITED, NULL, 1);
    expect(data == NULL && Sys_Get_LastError() == SYS_OK);
    Sys_Sleep(0);
}

static void questions(void)
{
    Sys_Start_CriticalSection();
    sent += Sys_Send_IntEvent(HEARD, 2);
    Sys_Start_CriticalSection();
    Sys_End_CriticalSection();
    expect(Sys_Get_ProcessID() == driver_pid && Sys_Get_SystemTime() != 0);
    Sys_End_CriticalSection();
    expect(Sys_Get_Statistics()->refused == 0 && Sys_Get_LostEvents(HEARD) <= 3);
    expect(Sys_Get_MotorSpeed_Left() == Sys_Get_MotorSpeed_Right() && Sys_Get_UnusedKernelStack() >= 32);
}

static void devices(void)
{
    expect(Sys_Toggle_LED(0) && Sys_Set_LED(0, false) && Sys_Get_Selector() < 16);
    expect(Sys_Write_UART2("ab", 2));
    (void)Sys_Set_TxProcessor(SYS_UART2, Sys_Raw_Tx);
    (void)Sys_Set_RxProcessor(SYS_UART2, each_byte);
    (void)Sys_Set_MotorProcessor(NULL);
    sent += Sys_Send_IntEvent(HEARD, 4);
    (void)Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 100);
    (void)Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, 100);
    Sys_Yield();
}

/* ---- Round of all scenes ------------------------------------------------------------------------------------------- */

static void (*const scenes[])(void) = {threads,   periodic,      registration, sending,   waiting,
                                       unregistering, time_out, questions,    devices};
enum { SCENES = sizeof scenes / sizeof scenes[0] };
const volatile uint16 scene_count __attribute__((used)) = SCENES;

/* Defines a function at which the harness stops. */
#define STOP(name)                                                    \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        __asm__ volatile("nop" ::: "memory");                         \
    }
STOP(scene_begin)
STOP(scene_end)

static void driver(void *unused)
{
    (void)unused;
    for (;;) {
        scene_begin();
        scenes[scene]();
        Sys_Yield(); /* delivers the last message of an interrupt */
        Sys_Yield();
        scene_end();
        scene = scene + 1 == SCENES ? 0 : scene + 1;
    }
}

int main(void)
{
    static const sys_process_config config = {driver, NULL, 224, 0, 0, 0, 0};
    Sys_Init_Kernel();
    Sys_Register_Event(HEARD);
    Sys_Register_Event(AWAITED);
    Sys_Subscribe_to_Event(HEARD, 0, listener, NULL);
    Sys_Subscribe_to_Event(SYS_UART1_RECEIVED, 0, on_byte, NULL);
    Sys_Set_RxProcessor(SYS_UART1, each_byte);
    checker_pid = Sys_Start_Process(pattern_checker);
    driver_pid = Sys_Start_ProcessWith(&config);
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 100);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, 100);
    IPC4bits.INT1IP = 4;
    IPC5bits.INT2IP = 6;
    IEC1bits.INT1IE = 1;
    IEC1bits.INT2IE = 1;
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}

/* Called by checker.S. */
__attribute__((used)) void checker_yield(void)
{
    Sys_Yield();
}
