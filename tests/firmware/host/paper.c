/* Behaviour that the paper describes (Trenkwalder et al., IROS 2016), paraphrased in openswarm-original.md §2-§6 and
 * engines.md §6. Each test checks one statement. */
#include "test.h"

static char handler_trace[64];
static void handler_note(char c)
{
    handler_trace[strlen(handler_trace)] = c;
}

static bool note_h(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    note('h');
    return true;
}
static bool note_g(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    note('g');
    return true;
}

static void busy(void *c)
{
    for (;;) {
        note(*(const char *)c);
        host_slice(); /* ends the slice of 10 ms of this thread */
    }
}

static uint16 start_busy(const char *c, uint8 priority)
{
    sys_process_config config = {busy, (void *)c, 0, priority, 0, 0, 0};
    return Sys_Start_ProcessWith(&config);
}

TEST(threads_share_the_processor_by_round_robin, "the paper: preemptive scheduling, round robin by default")
{
    boot();
    start_busy("a", 0);
    start_busy("b", 0);
    start_busy("c", 0);
    for (int i = 0; i < 4; i++) {
        host_slice();
    }
    CHECK(strcmp(trace, "abcabcabcabc") == 0);
}

TEST(the_scheduler_is_exchanged_at_run_time, "the paper: the scheduling algorithm can be exchanged during run time")
{
    boot();
    Sys_Start_CriticalSection();
    uint16 a = start_busy("a", 1);
    uint16 b = start_busy("b", 2);
    Sys_Set_Scheduler(&sys_fixed_priority);
    Sys_End_CriticalSection();
    os_system.priority = 3; /* PID 0 preempts them and so decides when they run */
    Sys_Yield();
    CHECK_EQ(trace[0], '\0');
    os_system.priority = 0;
    Sys_Set_Scheduler(&sys_round_robin);
    host_slice();
    CHECK(strcmp(trace, "ab") == 0);
    Sys_Kill_Process(a);
    Sys_Kill_Process(b);
}

static void end_note(void)
{
    note('n');
    CHECK_EQ(Sys_Get_ProcessState(Sys_Get_ProcessID()), SYS_RUNNING);
    Sys_Sleep(2);
}

TEST(a_process_is_new_ready_running_blocked_or_zombie, "the paper: five process states")
{
    boot();
    uint16 pid = Sys_Start_Process(end_note);
    CHECK_EQ(Sys_Get_ProcessState(pid), SYS_NEW);
    CHECK_EQ(Sys_Get_ProcessState(0), SYS_RUNNING);
    Sys_Yield();
    CHECK_EQ(Sys_Get_ProcessState(pid), SYS_BLOCKED);
    Sys_Sleep(5);
    CHECK_EQ(Sys_Get_ProcessState(pid), SYS_UNKNOWN); /* the thread is a zombie until the kernel stack has freed it */
}

TEST(handlers_run_between_two_threads_in_order_of_subscription, "the paper: cooperative event handling between time slices")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, note_h, NULL);
    Sys_Subscribe_to_Event(E1, 0, note_g, NULL);
    start_busy("a", 0);
    Sys_Send_IntEvent(E1, 1);
    CHECK_EQ(trace[0], '\0');
    host_slice();
    CHECK(strcmp(trace, "hga") == 0);
}

static bool must_not_be_preempted(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    handler_note('(');
    host_slice();
    Sys_Yield();
    handler_note(')');
    return true;
}

TEST(a_handler_runs_to_completion, "the paper: handlers are executed cooperatively")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, must_not_be_preempted, NULL);
    Sys_Subscribe_to_Event(E1, 0, note_h, NULL);
    start_busy("a", 0);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK(strcmp(handler_trace, "()") == 0);
    CHECK_EQ(trace[0], 'h');
    CHECK_EQ(Sys_Get_Statistics()->refused, 1);
}

static void device(void)
{
    note('i');
}
static bool interrupted(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    note('(');
    host_device(device);
    note(')');
    return true;
}

TEST(an_interrupt_preempts_a_handler, "the paper: only interrupts preempt event handlers")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, interrupted, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK(strcmp(trace, "(i)") == 0);
}

static uint16 values[8];
static int value_count;
static bool collect(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    values[value_count++] = data->value;
    return true;
}

TEST(events_are_processed_in_the_order_they_were_sent, "the paper: events are queued and processed sequentially")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Register_Event(E2);
    Sys_Subscribe_to_Event(E2, 0, collect, NULL);
    Sys_Subscribe_to_Event(E1, 0, collect, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Send_IntEvent(E2, 2);
    Sys_Send_IntEvent(E1, 3);
    Sys_Yield();
    CHECK_EQ(value_count, 3);
    CHECK(values[0] == 1 && values[1] == 2 && values[2] == 3);
}

static uint8 payload_copy[5];
static bool keep_payload(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    CHECK_EQ(data->size, 5);
    memcpy(payload_copy, data->payload, 5);
    return true;
}

TEST(an_event_carries_a_copy_of_its_data, "the paper: an event is an identifier and data; the data are copied")
{
    boot();
    uint8 data[5] = {1, 2, 3, 4, 5};
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, keep_payload, NULL);
    Sys_Send_Event(E1, data, sizeof data);
    memset(data, 0, sizeof data);
    Sys_Yield();
    CHECK(payload_copy[0] == 1 && payload_copy[4] == 5);
}

static uint16 pids[4];
static int pid_count;
static bool collect_pid(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)id, (void)data;
    pids[pid_count++] = pid;
    return true;
}

TEST(a_handler_shared_by_two_threads_runs_once_for_each, "the paper: processes subscribe with a handler; kernel.md §2")
{
    boot();
    Sys_Register_Event(E1);
    uint16 a = start_busy("a", 0), b = start_busy("b", 0);
    Sys_Subscribe_to_Event(E1, a, collect_pid, NULL);
    Sys_Subscribe_to_Event(E1, b, collect_pid, NULL);
    Sys_Subscribe_to_Event(E1, a, collect_pid, NULL); /* duplicate: a handler is registered once per event and thread */
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(pid_count, 2);
    CHECK(pids[0] == a && pids[1] == b);
}

static bool is_even(sys_event_data *data)
{
    return data->value % 2 == 0;
}

TEST(a_handler_runs_only_when_its_condition_holds, "the paper: a condition function filters events")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, collect, is_even);
    for (uint16 i = 1; i <= 4; i++) {
        Sys_Send_IntEvent(E1, i);
    }
    Sys_Yield();
    CHECK_EQ(value_count, 2);
    CHECK(values[0] == 2 && values[1] == 4);
}

static uint16 ticks;
static bool wait250times(sys_event_data *data)
{
    (void)data;
    return ++ticks == 250;
}
static uint32 woken_at;
static void logger(void)
{
    sys_event_data *data = Sys_Wait_for_Condition(SYS_1ms_TIMER, wait250times);
    woken_at = Sys_Get_SystemTime();
    Sys_Clear_EventData(&data);
}

TEST(a_thread_waits_for_a_condition_without_polling, "Listing 1: Sys_Wait_for_Condition(SYS_1ms_TIMER, wait250times)")
{
    boot();
    uint16 pid = Sys_Start_Process(logger);
    Sys_Sleep(249);
    CHECK_EQ(Sys_Get_ProcessState(pid), SYS_BLOCKED);
    Sys_Sleep(5);
    CHECK_EQ(woken_at, 250);
    CHECK_EQ(ticks, 250);
}

TEST(a_critical_section_postpones_the_tick_to_its_end, "the paper: in critical sections the switch is postponed")
{
    boot();
    start_busy("a", 0);
    Sys_Start_CriticalSection();
    host_slice();
    CHECK_EQ(trace[0], '\0');
    Sys_End_CriticalSection();
    CHECK_EQ(trace[0], 'a');
}

TEST(memory_is_taken_when_needed_and_returned, "the paper: RAM grows with processes, events and pending data, Eq. (1)")
{
    boot();
    uint16 before = heap_now();
    Sys_Register_Event(E1);
    uint16 event_bytes = (uint16)(heap_now() - before);
    CHECK_EQ(event_bytes, sizeof(event));
    Sys_Subscribe_to_Event(E1, 0, collect, NULL);
    CHECK_EQ(heap_now() - before, sizeof(event) + sizeof(subscription));
    Sys_Send_Event(E1, "12345678", 8);
    CHECK_EQ(heap_now() - before, sizeof(event) + sizeof(subscription) + sizeof(message) + 8);
    Sys_Yield();
    CHECK_EQ(heap_now() - before, sizeof(event) + sizeof(subscription));
    Sys_Unregister_Event(E1);
    CHECK_EQ(heap_now(), before);
}

static uint32 idles;
static void count_idle(uint32_t n)
{
    idles = n;
}

TEST(the_processor_idles_when_nothing_is_ready, "the paper: the processor is idle when no process needs it")
{
    boot();
    host_at_idle(count_idle);
    Sys_Sleep(10);
    CHECK_EQ(idles, 10);
}
