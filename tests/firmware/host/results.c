/* Results of waits, and the end of threads that wait (kernel.md §2). */
#include "test.h"

static sys_event_data *first_result;
static void wait_twice(void)
{
    first_result = Sys_Wait_for_Event(E1);
    sys_event_data *second = Sys_Wait_for_Event(E1); /* frees the first result */
    CHECK(second != NULL);
    note('2');
    /* returns without clearing the result: the thread's end frees it */
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
    CHECK(Sys_Kill_Process(pid)); /* while the message to the thread is queued */
    Sys_Yield();
    CHECK_EQ(heap_now(), before);
    pid = Sys_Start_Process(wait_twice);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 5);
    Sys_Yield();
    CHECK(Sys_Kill_Process(pid)); /* while the thread owns a result */
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

TEST(a_thread_may_die_during_a_delivery_to_it, "kernel.md §2: also while a drain stands on them")
{
    boot();
    Sys_Register_Event(E1);
    uint16 before = heap_now();
    victim = Sys_Start_Process(yield_for_ever);
    Sys_Subscribe_to_Event(E1, 0, kill_victim, NULL);
    Sys_Subscribe_to_Event(E1, victim, count_delivery, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(deliveries, 0);
    Sys_Unsubscribe_from_Event(E1, 0);
    victim = Sys_Start_Process(wait_and_be_killed);
    Sys_Start_Process(wait_and_be_killed);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 1); /* the first waiter's condition kills the first waiter; the second's finds it ended */
    Sys_Yield();
    CHECK_EQ(trace[0], '\0');
    CHECK_EQ(Sys_Get_ProcessState(victim), SYS_UNKNOWN);
    CHECK(Sys_Kill_Process((uint16)(victim + 1)));
    CHECK_EQ(heap_now(), before);
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
    victim = Sys_Start_Process(yield_for_ever);
    Sys_Subscribe_to_Event(E1, victim, count_delivery, kill_victim_when_asked);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(deliveries, 0);
    CHECK_EQ(Sys_Get_ProcessState(victim), SYS_UNKNOWN);
    CHECK_EQ(heap_now(), empty);
}

static void keep_result(void)
{
    (void)Sys_Wait_for_Event(E1);
    note('k');
    yield_for_ever();
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
