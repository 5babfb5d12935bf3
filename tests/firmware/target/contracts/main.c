/* Makes one call in a kernel whose sizes the test sets in RAM; test_contract_cycles.py measures it. All calls go through
 * pointers, so that each function is linked as one. */
#include <openswarm.h>
#include <openswarm_interrupt.h>
#include <openswarm_io.h>
#include <openswarm_scheduler.h>
#include <p30F6014A.h>

enum { AWAITED = SYS_FIRST_USER_EVENT, HELD, OTHER, BUCKETS = 8 };
enum { SLEEP, WAIT, WAIT_CONDITION, WAIT_TIMEOUT, PERIOD, CLEAR, WRITE };

/* Set by the test at `contracts_begin`. */
volatile uint16 wanted __attribute__((used));  /* the call */
volatile uint16 resting __attribute__((used)); /* other threads that wait without time-out */
volatile uint16 napping __attribute__((used)); /* other threads whose time-out is far */
volatile uint16 due __attribute__((used));     /* other threads whose time-out has expired, and that are not yet awake */
volatile uint16 ready __attribute__((used));   /* other threads that are ready */
volatile uint16 newer __attribute__((used));   /* newer events in the bucket of AWAITED */
volatile uint16 held __attribute__((used));    /* threads that hold the wait result; the last one is the caller */
volatile uint16 late __attribute__((used));    /* 1: after the deadline; 2: after the next release, too */
volatile uint16 bytes __attribute__((used));   /* of a message */

static void (*volatile sleep)(uint16) = Sys_Sleep;
static sys_event_data *(*volatile wait)(uint16) = Sys_Wait_for_Event;
static sys_event_data *(*volatile wait_condition)(uint16, sys_condition) = Sys_Wait_for_Condition;
static sys_event_data *(*volatile wait_timeout)(uint16, sys_condition, uint16) = Sys_Wait_for_ConditionTimeout;
static bool (*volatile wait_period)(void) = Sys_Wait_for_Period;
static void (*volatile clear)(sys_event_data **) = Sys_Clear_EventData;
static bool (*volatile write)(const void *, uint16) = Sys_Write_UART1;

#define STOP(name)                                                    \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        __asm__ volatile("nop" ::: "memory");                         \
    }

STOP(contracts_begin)
STOP(contracts_ready)
STOP(contracts_done)

static bool any(sys_event_data *data)
{
    return data != NULL;
}

static bool missed(uint16 pid, uint16 event, sys_event_data *data)
{
    return pid == 0 || event == 0 || data != NULL;
}

static void rest(void *unused)
{
    (void)unused;
    (void)Sys_Wait_for_Event(OTHER);
}

/* Each one's time-out is before those of the threads that sleep already, so that each sets the alarm. */
static void nap(void *unused)
{
    static uint16 ms = 60000;
    (void)unused;
    ms = (uint16)(ms - 100);
    Sys_Sleep(ms);
}

static void wake_soon(void *unused)
{
    (void)unused;
    Sys_Sleep(1);
}

static void hold(void *unused)
{
    (void)unused;
    (void)Sys_Wait_for_Event(HELD);
    Sys_Sleep(60000);
}

/* Runs while the measured thread waits, and ends its waits. */
static void others(void *unused)
{
    (void)unused;
    for (;;) {
        (void)Sys_Send_IntEvent(HELD, 1);
        (void)Sys_Send_IntEvent(AWAITED, 1);
        Sys_Yield();
    }
}

static void start(void (*entry)(void *), uint16 number)
{
    sys_process_config config = {entry, NULL, 0, 3, 0, 0, 0};
    while (number-- != 0) {
        (void)Sys_Start_ProcessWith(&config);
    }
}

static void next_tick(void)
{
    uint16 now = (uint16)Sys_Get_SystemTime();
    while ((uint16)Sys_Get_SystemTime() == now) {
    }
}

static void measured(void *unused)
{
    static uint8 message[64];
    sys_event_data *data = NULL;
    (void)unused;
    (void)Sys_Register_Event(HELD);
    (void)Sys_Register_Event(OTHER);
    (void)Sys_Register_Event(AWAITED);
    for (uint16 k = 1; k <= newer; k++) {
        (void)Sys_Register_Event((uint16)(AWAITED + k * BUCKETS));
    }
    start(rest, resting);
    start(nap, napping);
    if (held != 0) {
        start(hold, held - 1u);
        data = Sys_Wait_for_Event(HELD);
    }
    if (late != 0) {
        (void)Sys_Register_Event(SYS_DEADLINE_MISSED);
        (void)Sys_Subscribe_to_Event(SYS_DEADLINE_MISSED, 0, missed, NULL);
    }
    Sys_Sleep(2);
    start(wake_soon, due); /* each blocks at once: its priority is higher */
    Sys_Set_Scheduler(&sys_round_robin);
    next_tick();
    contracts_ready();
    switch (wanted) {
    case SLEEP: sleep(2); break;
    case WAIT: (void)wait(AWAITED); break;
    case WAIT_CONDITION: (void)wait_condition(AWAITED, any); break;
    case WAIT_TIMEOUT: (void)wait_timeout(AWAITED, any, 20000); break;
    case PERIOD: (void)wait_period(); break;
    case CLEAR: clear(&data); break;
    default: (void)write(message, bytes); break;
    }
    contracts_done();
    for (;;) {
        Sys_Sleep(60000);
    }
}

/* ---- Functions that the test only bounds ------------------------------------------------------------------------- */

static void on_press(void)
{
}

SYS_INTERRUPT(INT1, 4, on_press)

__attribute__((noinline, used)) void disable_interrupt(void)
{
    Sys_Disable_Interrupt(INT1);
}

__attribute__((noinline, used)) void raise_interrupt(void)
{
    Sys_Raise_Interrupt(INT1);
}

static sys_function volatile bounded[] __attribute__((used)) = {
    (sys_function)Sys_Get_ProcessID,
    (sys_function)Sys_Get_Statistics,
    (sys_function)Sys_Get_MotorSpeed_Left,
    (sys_function)Sys_Get_MotorSpeed_Right,
    (sys_function)Sys_Get_Selector,
    (sys_function)Sys_Get_UARTStatistics,
    (sys_function)Sys_Set_SelectorProcessor,
    (sys_function)Sys_Set_MotorProcessor,
    (sys_function)Sys_Set_TxProcessor,
    (sys_function)Sys_Set_RxProcessor,
    (sys_function)Sys_Connect_Motors,
    (sys_function)Sys_Write_UART2,
    (sys_function)Sys_Subscribe_to_Event,
    (sys_function)Sys_Unsubscribe_from_Event,
    (sys_function)Sys_Unsubscribe_Handler,
    sys_enable_INT1,
    (sys_function)Sys_Set_LED,
    (sys_function)Sys_Toggle_LED,
    (sys_function)Sys_Next_Ready,
    (sys_function)Sys_Pid_Of,
    (sys_function)Sys_Priority_Of,
};

int main(void)
{
    static sys_process_config config = {measured, NULL, 0, 2, SYS_PERIODIC, 50, 50};
    Sys_Init_Kernel();
    contracts_begin();
    if (late != 0) {
        config.deadline_ms = 1;
        config.period_ms = late == 1 ? 50 : 1;
    }
    Sys_Set_Scheduler(&sys_fixed_priority);
    Sys_Enable_Interrupt(INT1);
    (void)Sys_Start_ProcessWith(&config);
    (void)bounded[0];
    static const sys_process_config next = {others, NULL, 0, 1, 0, 0, 0};
    for (uint16 k = 0; k <= ready; k++) {
        (void)Sys_Start_ProcessWith(&next);
    }
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
