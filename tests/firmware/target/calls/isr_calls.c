/* Every call of the public headers, made by an interrupt. Permitted calls change nothing apart from the events that
 * they send; all other calls must be refused. tests/firmware/kernel/test_every_instruction.py compares the two lists
 * with the contract lines of the headers. */
#include "isr_calls.h"

#include <openswarm_io.h>
#include <openswarm_scheduler.h>

volatile uint16 isr_wanted __attribute__((used)), isr_extra __attribute__((used)), isr_wrong __attribute__((used));

static void expect(bool holds)
{
    isr_wrong += !holds;
}

/* ---- Calls that an interrupt may make --------------------------------------------------------------------------- */

static void sends_an_event(void)
{
    static const uint8 byte = 7;
    bool sent = Sys_Send_Event(HEARD, &byte, sizeof byte);
    isr_extra += sent;
    expect(sent && !Sys_Send_Event(UNKNOWN, &byte, sizeof byte) && Sys_Get_LastError() == SYS_ERROR_EVENT);
}

static void sends_a_number(void)
{
    bool sent = Sys_Send_IntEvent(HEARD, 5);
    isr_extra += sent;
    expect(sent);
}

static void asks_for_an_event(void)
{
    expect(Sys_IsEventRegistered(HEARD) && !Sys_IsEventRegistered(UNKNOWN));
}

static void changes_no_section(void)
{
    Sys_End_CriticalSection();
    Sys_Start_CriticalSection();
    Sys_Start_CriticalSection();
}

static void changes_the_scheduler(void)
{
    expect(Sys_Set_Scheduler(&sys_earliest_deadline) && Sys_Set_Scheduler(&sys_fixed_priority));
    expect(Sys_Set_Scheduler(&sys_round_robin) && !Sys_Set_Scheduler(NULL));
}

static void asks_the_kernel(void)
{
    expect(Sys_Get_ProcessID() < 0x8000 && Sys_Get_SystemTime() != 0 && Sys_Get_LostEvents(HEARD) == 0);
    expect(Sys_Get_Statistics()->heap_used != 0 && Sys_Get_LastError() <= SYS_ERROR_BUSY);
    expect(Sys_Get_UnusedKernelStack() < SYS_KERNEL_STACK);
}

static void asks_the_devices(void)
{
    expect(Sys_Get_Selector() < 16 && Sys_Get_UARTStatistics(SYS_UART1)->rx_lost == 0);
    expect(Sys_Get_MotorSpeed_Left() <= SYS_MAXIMUM_SPEED && Sys_Get_MotorSpeed_Right() <= SYS_MAXIMUM_SPEED);
}

static void switches_devices(void)
{
    expect(Sys_Toggle_LED(1) && Sys_Toggle_LED(1) && Sys_Set_LED(2, false));
    (void)Sys_Set_RxProcessor(SYS_UART1, each_byte);
    (void)Sys_Set_SelectorProcessor(NULL);
}

/* ---- Calls that the kernel must refuse -------------------------------------------------------------------------- */

static void nothing(void)
{
}

static bool never_heard(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    isr_wrong++;
    return true;
}

static void is_refused(void)
{
    static const sys_process_config config = {NULL, NULL, 0, 0, 0, 0, 0};
    sys_statistics *statistics = (sys_statistics *)Sys_Get_Statistics();
    uint16 before = statistics->refused;
    sys_event_data dummy = {0, 0, NULL}, *data = &dummy;
    expect(Sys_Start_Process(nothing) == 0 && Sys_Start_ProcessWith(&config) == 0);
    expect(!Sys_Kill_Process(driver_pid));
    expect(!Sys_Register_Event(PASSING) && !Sys_Unregister_Event(HEARD));
    expect(!Sys_Subscribe_to_Event(HEARD, 0, never_heard, NULL) && !Sys_Unsubscribe_from_Event(HEARD, 0));
    expect(!Sys_Unsubscribe_Handler(HEARD, 0, never_heard));
    expect(Sys_Get_ProcessState(driver_pid) == SYS_UNKNOWN && Sys_Get_UnusedStack(driver_pid) == 0);
    Sys_Yield();
    Sys_Sleep(1);
    expect(!Sys_Wait_for_Period());
    expect(Sys_Wait_for_Event(HEARD) == NULL && Sys_Wait_for_Condition(HEARD, NULL) == NULL);
    expect(Sys_Wait_for_ConditionTimeout(HEARD, NULL, 1) == NULL);
    Sys_Clear_EventData(&data);
    Sys_Run_SystemThread();
    expect(data == NULL && statistics->refused == before + 18u && Sys_Get_LastError() == SYS_ERROR_CONTEXT);
    statistics->refused = before;
}

static void (*const acts[])(void) = {sends_an_event,  sends_a_number,   asks_for_an_event, changes_no_section, changes_the_scheduler,
                                     asks_the_kernel, asks_the_devices, switches_devices,  is_refused};
enum { ACTS = sizeof acts / sizeof acts[0], ALL = 0xFFFF };
const volatile uint16 isr_acts __attribute__((used)) = ACTS;

void isr_calls(void)
{
    uint16 wanted = isr_wanted;
    isr_wanted = 0;
    for (uint16 i = 0; i < ACTS; i++) {
        if (wanted == ALL || wanted == i + 1) {
            acts[i]();
        }
    }
}
