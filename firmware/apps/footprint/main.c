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

static void rest_with_argument(void *unused)
{
    (void)unused;
    rest();
}

static const sys_process_config resting = {rest_with_argument, NULL, 0, 0, 0, 0, 0};

/* Every call of the paper's Table I and the rest of the interface is linked, whether the load uses it or not. */
static void use_everything(void)
{
    sys_event_data *data = Sys_Wait_for_Event(FIRST_EVENT);
    Sys_Clear_EventData(&data);
    data = Sys_Wait_for_ConditionTimeout(FIRST_EVENT, NULL, Sys_Get_LastError());
    data = Sys_Wait_for_Condition(FIRST_EVENT, NULL);
    Sys_Set_Scheduler(data != NULL ? &sys_fixed_priority : &sys_earliest_deadline);
    Sys_Set_Scheduler(&sys_round_robin);
    Sys_Start_CriticalSection();
    Sys_End_CriticalSection();
    Sys_Yield();
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, (uint16)Sys_Get_MotorSpeed_Left());
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)Sys_Get_MotorSpeed_Right());
    if (Sys_IsEventRegistered((uint16)Sys_Get_SystemTime()) && Sys_Wait_for_Period()) {
        Sys_Start_ProcessWith(&resting);
        Sys_Unsubscribe_Handler(FIRST_EVENT, Sys_Get_ProcessID(), listen);
        SYS_ASSERT(Sys_Get_LostEvents(FIRST_EVENT) == 0 && Sys_Get_UnusedStack(1) != 0);
        SYS_ASSERT(Sys_Get_ProcessState(1) == SYS_BLOCKED && Sys_Get_UnusedKernelStack() != 0);
    }
}

static void measure(void)
{
    footprint_now.heap_used = Sys_Get_Statistics()->heap_used;
    footprint_now.heap_peak = Sys_Get_Statistics()->heap_peak;
    footprint_now.kernel_stack_unused = Sys_Get_UnusedKernelStack();
    footprint_now.thread_stack_unused = pids[0] != 0 ? Sys_Get_UnusedStack(pids[0]) : 0;
}

/* s subscriptions are spread over the events, two handlers at most to each (thread, event) pair. */
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
    for (uint16 i = 0; i < footprint_wanted.messages; i++) { /* queued: main holds delivery back */
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
    Sys_Yield();
    measure();
    footprint_undone();
    Sys_Start_Process(use_everything);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
