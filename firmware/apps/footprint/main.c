/* Builds a kernel load of known size for memory measurements. README.md: what to set, where to stop, what to read. */
#include <openswarm.h>
#include <openswarm_io.h>

#include "footprint.h"

volatile footprint_request footprint_wanted __attribute__((used));
volatile footprint_result footprint_now __attribute__((used));

enum { FIRST_EVENT = SYS_FIRST_USER_EVENT };

static uint16 pids[FOOTPRINT_THREADS];
static const uint8 payload[FOOTPRINT_PAYLOAD];

static bool listen(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    return true;
}

static bool listen_too(uint16 pid, uint16 event, sys_event_data *data)
{
    return listen(pid, event, data);
}

static void rest(void)
{
    for (;;) {
        Sys_Sleep(60000);
    }
}

/* Links every call of the paper's Table I and of the rest of the interface, whether the load uses it or not. The
 * compiler does not know the arguments, so it cannot remove a call. */
static volatile struct {
    uint16 event, pid, ms;
    sys_handler handler;
    sys_condition condition;
    sys_function entry;
    const sys_process_config *config;
    const char *text;
    sys_event_data *data;
} any;

static void use_everything(void)
{
    sys_event_data *data = Sys_Wait_for_Event(any.event);
    Sys_Clear_EventData(&data);
    any.data = Sys_Wait_for_ConditionTimeout(any.event, any.condition, any.ms);
    any.data = Sys_Wait_for_Condition(any.event, any.condition);
    Sys_Set_Scheduler(any.pid != 0 ? &sys_fixed_priority : &sys_earliest_deadline);
    Sys_Set_Scheduler(&sys_round_robin);
    Sys_Start_CriticalSection();
    Sys_End_CriticalSection();
    Sys_Yield();
    Sys_Sleep(any.ms);
    Sys_Wait_for_Period();
    Sys_Register_Event(any.event);
    Sys_Send_Event(any.event, any.text, any.ms);
    Sys_Send_IntEvent(any.event, (uint16)(Sys_Get_MotorSpeed_Left() + Sys_Get_MotorSpeed_Right()));
    Sys_Subscribe_to_Event(any.event, any.pid, any.handler, any.condition);
    Sys_Unsubscribe_Handler(any.event, any.pid, any.handler);
    Sys_Unsubscribe_from_Event(any.event, any.pid);
    Sys_Unregister_Event(any.event);
    any.pid = Sys_Start_Process(any.entry);
    any.pid = Sys_Start_ProcessWith(any.config);
    Sys_Kill_Process(Sys_Get_ProcessID());
    any.event = Sys_IsEventRegistered(any.event) + Sys_Get_LostEvents(any.event) + Sys_Get_LastError();
    any.ms = (uint16)Sys_Get_SystemTime() + Sys_Get_UnusedStack(any.pid) + Sys_Get_UnusedKernelStack();
    any.pid = (uint16)Sys_Get_ProcessState(any.pid);
    Sys_Toggle_LED((uint8)any.pid);
    Sys_Set_LED((uint8)any.pid, Sys_Get_Selector() != 0);
    Sys_Assertion_Failed(any.text, any.pid);
}

static void measure(void)
{
    footprint_now.heap_used = Sys_Get_Statistics()->heap_used;
    footprint_now.heap_peak = Sys_Get_Statistics()->heap_peak;
    footprint_now.kernel_stack_unused = Sys_Get_UnusedKernelStack();
    footprint_now.thread_stack_unused = pids[0] != 0 ? Sys_Get_UnusedStack(pids[0]) : 0;
}

/* Distributes s subscriptions over the events, with at most two handlers for each (thread, event) pair. */
static uint16 subscribe(uint16 wanted, uint16 events)
{
    uint16 done = 0;
    for (uint16 pid = 0; pid <= footprint_wanted.threads && done < wanted; pid++) {
        for (uint16 e = 0; e < events && done < wanted; e++) {
            uint16 owner = pid == 0 ? 0 : pids[pid - 1];
            done += Sys_Subscribe_to_Event(FIRST_EVENT + e, owner, listen, NULL);
            done += done < wanted && Sys_Subscribe_to_Event(FIRST_EVENT + e, owner, listen_too, NULL);
        }
    }
    return done;
}

static void build(void)
{
    footprint_now.threads = footprint_now.events = footprint_now.messages = 0;
    for (uint16 i = 0; i < footprint_wanted.threads; i++) {
        pids[i] = Sys_Start_Process(rest);
        footprint_now.threads += pids[i] != 0;
    }
    for (uint16 i = 0; i < footprint_wanted.events; i++) {
        footprint_now.events += Sys_Register_Event(FIRST_EVENT + i);
    }
    footprint_now.subscriptions = subscribe(footprint_wanted.subscriptions, footprint_wanted.events);
    for (uint16 i = 0; i < footprint_wanted.messages; i++) { /* queued: main is in a critical section */
        footprint_now.messages += Sys_Send_Event(FIRST_EVENT, payload, footprint_wanted.payload);
    }
}

static void undo(void)
{
    for (uint16 i = 0; i < footprint_wanted.threads; i++) {
        Sys_Kill_Process(pids[i]);
        pids[i] = 0;
    }
    for (uint16 i = 0; i < footprint_wanted.events; i++) {
        Sys_Unsubscribe_from_Event(FIRST_EVENT + i, 0);
        Sys_Unregister_Event(FIRST_EVENT + i);
    }
}

int main(void)
{
    Sys_Init_Kernel();
    footprint_begin();
    measure();
    footprint_empty();
    Sys_Start_CriticalSection();
    build();
    measure();
    footprint_built();
    Sys_End_CriticalSection();
    undo();
    Sys_Start_Kernel();
    Sys_Yield(); /* messages whose event is gone are dropped */
    measure();
    footprint_undone();
    Sys_Start_Process(use_everything);
    Sys_Run_SystemThread();
    return 0;
}
