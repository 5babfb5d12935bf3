/* Semantics of kernel.md §2 beyond the paper, and the corners of each call. */
#include "test.h"

static int calls;
static bool count_calls(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    calls++;
    return true;
}
static bool once(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    calls++;
    return false;
}
static void idle_thread(void)
{
    for (;;) {
        Sys_Yield();
    }
}

static sys_event_data *refused_wait;
static bool blocking_condition(sys_event_data *data)
{
    (void)data;
    refused_wait = Sys_Wait_for_Event(E1);
    Sys_Sleep(3);
    return true;
}

TEST(blocking_calls_are_refused_outside_threads, "kernel.md §2: handler, ISR, condition and critical section")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_calls, blocking_condition);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(calls, 1);
    CHECK(refused_wait == NULL);
    CHECK_EQ(Sys_Get_Statistics()->refused, 2);
    CHECK_EQ(Sys_Get_LastError(), SYS_OK);
    Sys_Start_CriticalSection();
    CHECK(Sys_Wait_for_Event(E1) == NULL);
    Sys_Sleep(1);
    Sys_Yield();
    Sys_End_CriticalSection();
    CHECK_EQ(Sys_Get_Statistics()->refused, 5);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_CONTEXT);
}

TEST(blocking_calls_are_refused_before_the_start, "openswarm.h: what may block is refused before Sys_Start_Kernel")
{
    host_use_virtual_time();
    Sys_Init_Kernel();
    CHECK(Sys_Wait_for_Event(SYS_1ms_TIMER) == NULL);
    CHECK(Sys_Wait_for_ConditionTimeout(SYS_1ms_TIMER, NULL, 1) == NULL);
    CHECK(!Sys_Wait_for_Period());
    Sys_Sleep(1);
    Sys_Sleep(0);
    Sys_Yield();
    Sys_Run_SystemThread();
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_CONTEXT);
    CHECK_EQ(Sys_Get_Statistics()->refused, 7);
    Sys_Start_CriticalSection();
    Sys_End_CriticalSection();
    Sys_Sleep(1);
    CHECK_EQ(Sys_Get_Statistics()->refused, 8);
    Sys_Start_Kernel();
    Sys_Sleep(1);
    CHECK_EQ(Sys_Get_SystemTime(), 1);
    CHECK_EQ(Sys_Get_Statistics()->refused, 8);
}

TEST(no_scheduler_is_refused, "openswarm.h: Sys_Set_Scheduler")
{
    boot();
    CHECK(Sys_Set_Scheduler(&sys_fixed_priority));
    CHECK(!Sys_Set_Scheduler(NULL));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    Sys_Start_Process(idle_thread);
    Sys_Yield();
}

static uint16 state_seen_by_isr;
static void ask_for_state(void)
{
    state_seen_by_isr = Sys_Get_ProcessState(0);
    CHECK_EQ(Sys_Get_UnusedStack(0), 0);
}

TEST(an_isr_may_not_walk_the_threads, "openswarm.h: the lists change under the slice lock only")
{
    boot();
    host_device(ask_for_state);
    CHECK_EQ(state_seen_by_isr, SYS_UNKNOWN);
    CHECK_EQ(Sys_Get_Statistics()->refused, 2);
}

static void isr_tries_everything(void)
{
    sys_process_config config = {0};
    CHECK(!Sys_Register_Event(E2) && !Sys_Unregister_Event(E1));
    CHECK(!Sys_Subscribe_to_Event(E1, 0, count_calls, NULL) && !Sys_Unsubscribe_from_Event(E1, 0));
    CHECK(!Sys_Kill_Process(1) && Sys_Start_ProcessWith(&config) == 0);
    CHECK(Sys_Wait_for_Event(E1) == NULL);
    CHECK(Sys_IsEventRegistered(E1) && Sys_Send_IntEvent(E1, 1));
    uint8 large[SYS_SMALL_PAYLOAD + 1] = {0};
    CHECK(!Sys_Send_Event(E1, large, sizeof large));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
}

TEST(an_isr_may_send_but_not_restructure, "openswarm.h: callers of each function")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_calls, NULL);
    host_device(isr_tries_everything);
    Sys_Yield();
    CHECK_EQ(calls, 1);
    CHECK(!Sys_IsEventRegistered(E2));
}

static sys_event_data *first_result;
static void wait_twice(void)
{
    first_result = Sys_Wait_for_Event(E1);
    sys_event_data *second = Sys_Wait_for_Event(E1); /* frees the first */
    CHECK(second != NULL);
    note('2');
    /* ends without clearing: the end frees it */
}

TEST(a_thread_owns_one_uncleared_result, "kernel.md §2: its next wait or its end frees it")
{
    boot();
    Sys_Register_Event(E1);
    uint16 before = heap_now();
    Sys_Start_Process(wait_twice);
    for (int i = 0; i < 6; i++) {
        Sys_Yield();
        Sys_Send_IntEvent(E1, 5);
        Sys_Yield();
    }
    CHECK_EQ(trace[0], '2');
    CHECK_EQ(heap_now(), before);
}

TEST(killing_a_waiting_thread_frees_its_wait, "kernel.md §2: subscriptions, waits and queued deliveries end")
{
    boot();
    Sys_Register_Event(E1);
    uint16 before = heap_now();
    uint16 pid = Sys_Start_Process(wait_twice);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 5);
    CHECK(Sys_Kill_Process(pid)); /* while its message is queued */
    Sys_Yield();
    CHECK_EQ(heap_now(), before);
    pid = Sys_Start_Process(wait_twice);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 5);
    Sys_Yield();
    CHECK(Sys_Kill_Process(pid)); /* while it owns a result */
    CHECK_EQ(heap_now(), before);
}

static uint16 victim;
static bool kill_victim(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    Sys_Kill_Process(victim);
    return true;
}
static bool kill_own_thread(sys_event_data *data)
{
    (void)data;
    return Sys_Kill_Process(victim);
}
static void wait_and_be_killed(void)
{
    Sys_Wait_for_Condition(E1, kill_own_thread);
    note('!');
}

TEST(a_thread_may_die_while_a_delivery_stands_on_it, "kernel.md §2: also while a drain stands on them")
{
    boot();
    Sys_Register_Event(E1);
    uint16 before = heap_now();
    victim = Sys_Start_Process(idle_thread);
    Sys_Subscribe_to_Event(E1, 0, kill_victim, NULL);
    Sys_Subscribe_to_Event(E1, victim, count_calls, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(calls, 0);
    Sys_Unsubscribe_from_Event(E1, 0);
    victim = Sys_Start_Process(wait_and_be_killed);
    Sys_Start_Process(wait_and_be_killed);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 1); /* the first waiter's condition kills it, the second's finds it gone */
    Sys_Yield();
    CHECK_EQ(trace[0], '\0');
    CHECK_EQ(Sys_Get_ProcessState(victim), SYS_UNKNOWN);
    CHECK(Sys_Kill_Process((uint16)(victim + 1)));
    CHECK_EQ(heap_now(), before);
}

static bool unregister_in_handler(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)data;
    calls++;
    CHECK(Sys_Unregister_Event(id));
    return true;
}
static void wait_for_gone(void)
{
    CHECK(Sys_Wait_for_Event(E1) == NULL);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_EVENT);
    note('g');
}

TEST(an_event_may_be_unregistered_by_its_own_handler, "openswarm.h: messages are dropped, waiters wake with NULL")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Start_Process(wait_for_gone);
    Sys_Yield();
    Sys_Subscribe_to_Event(E1, 0, unregister_in_handler, NULL);
    Sys_Subscribe_to_Event(E1, 0, count_calls, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Send_IntEvent(E1, 2);
    Sys_Yield();
    Sys_Yield();
    CHECK_EQ(calls, 1);
    CHECK_EQ(trace[0], 'g');
    CHECK(!Sys_Send_IntEvent(E1, 3));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_EVENT);
}

TEST(a_handler_that_returns_false_is_unsubscribed, "kernel.md §1: false = unsubscribe me")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, once, NULL);
    Sys_Subscribe_to_Event(E1, 0, count_calls, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(calls, 3);
}

static uint16 ended[3];
static bool on_termination(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    CHECK_EQ(Sys_Get_ProcessState(data->value), SYS_UNKNOWN);
    ended[calls++] = data->value;
    return true;
}
static void returns_at_once(void)
{
}

TEST(the_end_of_every_thread_is_told, "openswarm.h: SYS_EVENT_TERMINATION")
{
    boot();
    Sys_Subscribe_to_Event(SYS_EVENT_TERMINATION, 0, on_termination, NULL);
    uint16 before = heap_now(), returns = Sys_Start_Process(returns_at_once), killed = Sys_Start_Process(idle_thread);
    Sys_Yield();
    CHECK(Sys_Kill_Process(killed));
    Sys_Yield();
    CHECK_EQ(calls, 2);
    CHECK_EQ(ended[0], returns);
    CHECK_EQ(ended[1], killed);
    CHECK_EQ(heap_now(), before);
}

static int rounds_of_two[2];
static bool resubscribe(uint16 pid, uint16 id, int which, sys_handler self)
{
    CHECK(++rounds_of_two[which] < 100);
    CHECK(Sys_Unsubscribe_Handler(id, pid, self));
    CHECK(Sys_Subscribe_to_Event(id, pid, self, NULL));
    return true;
}
static bool resubscribe_one(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)data;
    return resubscribe(pid, id, 0, resubscribe_one);
}
static bool resubscribe_two(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)data;
    return resubscribe(pid, id, 1, resubscribe_two);
}

TEST(a_delivery_reaches_those_that_had_subscribed_when_it_began, "openswarm.h: Sys_Subscribe_to_Event")
{
    boot();
    Sys_Register_Event(E1);
    uint16 empty = heap_now();
    Sys_Subscribe_to_Event(E1, 0, resubscribe_one, NULL);
    Sys_Subscribe_to_Event(E1, 0, resubscribe_two, NULL);
    Sys_Subscribe_to_Event(E1, 0, count_calls, NULL);
    for (int i = 1; i <= 3; i++) {
        Sys_Send_IntEvent(E1, 1);
        Sys_Yield();
        CHECK_EQ(rounds_of_two[0], i);
        CHECK_EQ(rounds_of_two[1], i);
        CHECK_EQ(calls, i);
    }
    Sys_Unsubscribe_from_Event(E1, 0);
    CHECK_EQ(heap_now(), empty);
}

static bool subscribe_another(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)data;
    CHECK(Sys_Subscribe_to_Event(id, pid, count_calls, NULL));
    return true;
}

TEST(who_subscribes_during_a_delivery_hears_the_next_message, "openswarm.h: Sys_Subscribe_to_Event")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, subscribe_another, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(calls, 0);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(calls, 1);
}

static bool register_anew(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)data;
    CHECK(Sys_Unregister_Event(id) && Sys_Register_Event(id));
    CHECK(Sys_Subscribe_to_Event(id, pid, register_anew, NULL));
    CHECK(Sys_Subscribe_to_Event(id, pid, count_calls, NULL));
    CHECK(++rounds_of_two[0] < 100);
    return true;
}

TEST(an_event_registered_anew_by_its_handler_begins_anew, "openswarm.h: Sys_Unregister_Event")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, register_anew, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(rounds_of_two[0], 1);
    CHECK_EQ(calls, 0);
}

static bool kill_victim_when_asked(sys_event_data *data)
{
    (void)data;
    (void)Sys_Kill_Process(victim);
    return true;
}

TEST(a_condition_that_kills_its_owner_spares_the_handler, "openswarm.h: Sys_Kill_Process ends the subscriptions")
{
    boot();
    Sys_Register_Event(E1);
    uint16 empty = heap_now();
    victim = Sys_Start_Process(idle_thread);
    Sys_Subscribe_to_Event(E1, victim, count_calls, kill_victim_when_asked);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(calls, 0);
    CHECK_EQ(Sys_Get_ProcessState(victim), SYS_UNKNOWN);
    CHECK_EQ(heap_now(), empty);
}

static bool resubscribe_and_hold(sys_event_data *data)
{
    (void)data;
    CHECK(++rounds_of_two[0] < 100);
    CHECK(Sys_Unsubscribe_Handler(E1, 0, count_calls));
    CHECK(Sys_Subscribe_to_Event(E1, 0, count_calls, resubscribe_and_hold));
    return true;
}

TEST(a_condition_that_subscribes_its_handler_anew_hears_the_next_message, "openswarm.h: Sys_Subscribe_to_Event")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_calls, resubscribe_and_hold);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(calls, 0);
    CHECK_EQ(rounds_of_two[0], 1);
}

static void keep_result(void)
{
    (void)Sys_Wait_for_Event(E1);
    note('k');
    idle_thread();
}
static void wait_and_kill(void)
{
    sys_event_data *data = Sys_Wait_for_Condition(E1, kill_victim_when_asked);
    note(data != NULL && data->size == 5 && memcmp(data->payload, "event", 5) == 0 ? 'w' : '?');
    Sys_Clear_EventData(&data);
}

TEST(a_condition_may_kill_a_thread_that_the_same_message_woke, "openswarm.h: Sys_Wait_for_Condition")
{
    boot();
    Sys_Register_Event(E1);
    uint16 empty = heap_now();
    victim = Sys_Start_Process(keep_result);
    Sys_Start_Process(wait_and_kill);
    Sys_Yield();
    Sys_Send_Event(E1, "event", 5);
    Sys_Yield();
    Sys_Yield();
    CHECK(strcmp(trace, "w") == 0);
    CHECK_EQ(heap_now(), empty);
}

static void fail_with_memory(void)
{
    host_fail_allocation(1);
    CHECK(!Sys_Register_Event(E4));
    Sys_Yield();
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_MEMORY);
    note('m');
}
static void isr_fails(void)
{
    CHECK(!Sys_Send_IntEvent(E_NEVER, 1));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_EVENT);
}
static bool handler_fails(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    Sys_Sleep(1);
    host_device(isr_fails);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_CONTEXT);
    return true;
}

TEST(the_last_error_is_that_of_who_asks, "openswarm.h: Sys_Get_LastError")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, handler_fails, NULL);
    CHECK(!Sys_Subscribe_to_Event(E1, 0, NULL, NULL));
    host_device(isr_fails);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    Sys_Start_Process(fail_with_memory);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    Sys_Yield();
    CHECK(strcmp(trace, "m") == 0);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    Sys_Sleep(1);
    CHECK_EQ(Sys_Get_LastError(), SYS_OK);
}

static sys_event_data *isr_sees;
static void isr_clears(void)
{
    Sys_Clear_EventData(&isr_sees);
}
static void result_held(void)
{
    sys_event_data *data = Sys_Wait_for_Event(E1);
    isr_sees = data;
    uint16 before = heap_now();
    host_device(isr_clears);
    CHECK(isr_sees == NULL);
    CHECK_EQ(heap_now(), before);
    Sys_Clear_EventData(&data);
    CHECK(heap_now() < before);
    note('c');
}

TEST(an_isr_may_not_clear_a_result, "openswarm.h: Sys_Clear_EventData")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Start_Process(result_held);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 7);
    Sys_Yield();
    Sys_Yield();
    CHECK(strcmp(trace, "c") == 0);
}

TEST(an_event_nobody_listens_to_allocates_nothing, "kernel.md §2")
{
    boot();
    Sys_Register_Event(E1);
    unsigned long before = host_allocations();
    for (int i = 0; i < 100; i++) {
        CHECK(Sys_Send_IntEvent(E1, 1));
        host_tick();
    }
    CHECK_EQ(host_allocations(), before);
}

static bool resend(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid;
    calls++;
    Sys_Send_IntEvent(id, data->value);
    return true;
}

TEST(a_handler_that_resends_for_ever_starves_no_thread, "kernel.md §2: a drain handles what was queued when it began")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, resend, NULL);
    Sys_Send_IntEvent(E1, 1);
    for (int i = 1; i <= 50; i++) {
        Sys_Yield();
        CHECK_EQ(calls, i);
    }
}

static uint32 handled_at;
static bool when(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    handled_at = Sys_Get_SystemTime();
    return true;
}
static void send_from_isr(void)
{
    Sys_Send_IntEvent(E1, 1);
}
static void send_in_idle(uint32_t idle)
{
    if (idle == 4) {
        host_device(send_from_isr);
    }
}

TEST(an_event_is_handled_at_once_when_only_idle_is_ready, "kernel.md §2: not at the end of the slice")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, when, NULL);
    host_at_idle(send_in_idle);
    Sys_Sleep(20);
    CHECK_EQ(handled_at, 3);
}

TEST(sleep_and_timeouts_cover_the_whole_range_of_ms, "openswarm.h: Sys_Sleep")
{
    static const uint16 periods[] = {1, 2, 10, 999, 32767, 32768, 65535};
    boot();
    for (unsigned i = 0; i < sizeof periods / sizeof *periods; i++) {
        uint32 before = Sys_Get_SystemTime();
        Sys_Sleep(periods[i]);
        CHECK_EQ(Sys_Get_SystemTime() - before, periods[i]);
    }
    Sys_Register_Event(E1);
    uint32 before = Sys_Get_SystemTime();
    CHECK(Sys_Wait_for_ConditionTimeout(E1, NULL, 40000) == NULL);
    CHECK_EQ(Sys_Get_SystemTime() - before, 40000);
    CHECK_EQ(Sys_Get_LastError(), SYS_OK);
}

static uint16 lengths[5] = {7, 3, 300, 1, 40};
static char wake_order[8];
static void sleeper(void *which)
{
    Sys_Sleep(*(uint16 *)which);
    wake_order[strlen(wake_order)] = (char)('0' + ((uint16 *)which - lengths));
}

TEST(several_sleepers_wake_in_order_and_cost_no_event, "kernel.md §3")
{
    boot();
    unsigned long before;
    for (int i = 0; i < 5; i++) {
        sys_process_config config = {sleeper, &lengths[i], 0, 0, 0, 0, 0};
        Sys_Start_ProcessWith(&config);
    }
    Sys_Yield();
    before = host_allocations();
    Sys_Sleep(400);
    CHECK(strcmp(wake_order, "31042") == 0);
    CHECK_EQ(host_allocations(), before);
}

TEST(pids_are_not_reused_while_alive_and_skip_zero, "openswarm-original.md §3.2: the counter wrapped to 0")
{
    boot();
    uint16 old = Sys_Start_Process(idle_thread);
    for (long i = 0; i < 65600; i++) {
        uint16 pid = Sys_Start_Process(idle_thread);
        CHECK(pid != 0 && pid != old);
        Sys_Kill_Process(pid);
    }
}

TEST(the_system_thread_may_not_be_killed, "openswarm.h: Sys_Kill_Process")
{
    boot();
    CHECK(!Sys_Kill_Process(0));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_PROCESS);
}

TEST(bad_thread_configurations_are_refused, "openswarm.h: Sys_Start_ProcessWith")
{
    boot();
    sys_process_config good = {sleeper, NULL, 0, 0, 0, 0, 0}, bad = good;
    bad.entry = NULL;
    CHECK_EQ(Sys_Start_ProcessWith(&bad), 0);
    bad = good;
    bad.stack = SYS_MINIMUM_STACK - HEAP_STEP;
    CHECK_EQ(Sys_Start_ProcessWith(&bad), 0);
    bad = good;
    bad.stack = SYS_MINIMUM_STACK + 1;
    CHECK_EQ(Sys_Start_ProcessWith(&bad), 0);
    bad = good;
    bad.flags = SYS_PERIODIC;
    CHECK_EQ(Sys_Start_ProcessWith(&bad), 0);
    bad.period_ms = 10;
    bad.deadline_ms = 11;
    CHECK_EQ(Sys_Start_ProcessWith(&bad), 0);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
}

/* ---- Earliest deadline first ---------------------------------------------------------------------------------- */

static int met[3], missed[3];
static void job(void *which)
{
    int me = *(int *)which;
    for (;;) {
        for (int ms = 0; ms <= me * 2; ms++) { /* 1, 3 or 5 ms of work */
            host_tick();
            note((char)('a' + me));
        }
        if (Sys_Wait_for_Period()) {
            met[me]++;
        } else {
            missed[me]++;
        }
    }
}
static int indices[3] = {0, 1, 2};

static void start_job(int i, uint16 period, uint16 deadline)
{
    sys_process_config config = {job, &indices[i], 0, 0, SYS_PERIODIC, period, deadline};
    CHECK(Sys_Start_ProcessWith(&config) != 0);
}

static uint16 miss_pid;
static bool on_miss(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    miss_pid = data->value;
    calls++;
    return true;
}

TEST(earliest_deadline_first_meets_every_deadline_of_a_feasible_set, "kernel.md §2: EDF")
{
    boot();
    Sys_Set_Scheduler(&sys_earliest_deadline);
    start_job(0, 5, 5);   /* 1/5 + 3/10 + 5/20 = 0.75 */
    start_job(1, 10, 10);
    start_job(2, 20, 20);
    Sys_Sleep(1000);
    CHECK_EQ(missed[0] + missed[1] + missed[2], 0);
    CHECK(met[0] >= 198 && met[1] >= 98 && met[2] >= 48);
    CHECK_EQ(Sys_Get_Statistics()->deadlines_missed, 0);
}

TEST(a_missed_deadline_is_counted_and_reported, "kernel.md §2: a miss is counted and reported by event")
{
    boot();
    Sys_Register_Event(SYS_DEADLINE_MISSED);
    Sys_Subscribe_to_Event(SYS_DEADLINE_MISSED, 0, on_miss, NULL);
    Sys_Set_Scheduler(&sys_earliest_deadline);
    start_job(2, 50, 3); /* 5 ms of work due after 3 */
    Sys_Sleep(100);
    CHECK(missed[2] >= 1);
    CHECK(calls >= 1);
    CHECK_EQ(miss_pid, 1);
    CHECK_EQ(Sys_Get_Statistics()->deadlines_missed, calls);
}

static void job_without_end(void *unused)
{
    (void)unused;
    for (uint16 ms = 1;; ms++) {
        host_tick();
        if (ms % 10 == 0) {
            host_slice();
        }
    }
}

TEST(a_late_job_starves_nobody, "openswarm.h: sys_earliest_deadline; once it ran alone for as long as it was late")
{
    sys_process_config endless = {job_without_end, NULL, 0, 0, SYS_PERIODIC, 100, 50};
    boot();
    Sys_Set_Scheduler(&sys_earliest_deadline);
    CHECK(Sys_Start_ProcessWith(&endless) != 0);
    start_job(0, 5, 5);
    for (uint32 end = 4000; Sys_Get_SystemTime() < end;) {
        Sys_Sleep(500); /* a thread without a period: it comes to its turns */
    }
    CHECK(met[0] >= 790);
    CHECK_EQ(missed[0], 0);
    CHECK_EQ(Sys_Get_Statistics()->deadlines_missed, 1);
}

static void wait_note_h(void)
{
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(E1);
        note('H');
        Sys_Clear_EventData(&data);
    }
}

TEST(an_event_preempts_a_lower_priority_thread_at_once, "openswarm_scheduler.h: eager")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Set_Scheduler(&sys_fixed_priority);
    sys_process_config high = {((void (*)(void *))(void *)wait_note_h), NULL, 0, 5, 0, 0, 0};
    Sys_Start_ProcessWith(&high);
    Sys_Yield();
    note('<');
    Sys_Send_IntEvent(E1, 1);
    note('>');
    CHECK(strcmp(trace, "<H>") == 0);
}

/* ---- Clearing ------------------------------------------------------------------------------------------------- */

static bool clears_its_data(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    Sys_Clear_EventData(&data);
    CHECK(data == NULL);
    calls++;
    return true;
}

TEST(clearing_in_a_handler_leaves_the_data_to_the_kernel, "openswarm.h: Sys_Clear_EventData")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, clears_its_data, NULL);
    Sys_Subscribe_to_Event(E1, 0, count_calls, NULL);
    uint16 before = heap_now();
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(calls, 2);
    CHECK_EQ(heap_now(), before);
}

/* ---- Real time ------------------------------------------------------------------------------------------------ */

static volatile unsigned long spins[2];
static void spin(void *which)
{
    for (;;) {
        ++*(volatile unsigned long *)which;
    }
}

TEST(a_signal_preempts_threads_that_never_call_the_kernel, "port/posix/README.md: real time; design.md §6: 10 ms slices")
{
    sys_process_config a = {spin, (void *)&spins[0], 0, 0, 0, 0, 0}, b = {spin, (void *)&spins[1], 0, 0, 0, 0, 0};
    Sys_Init_Kernel();
    CHECK(Sys_Start_ProcessWith(&a) != 0 && Sys_Start_ProcessWith(&b) != 0);
    Sys_Start_Kernel();
    while (spins[0] == 0 || spins[1] == 0) { /* PID 0 spins as well; the alarm of main.c ends a failure */
    }
    unsigned long before = spins[1];
    while (spins[1] == before) {
    }
    CHECK(Sys_Get_SystemTime() > 0);
}
