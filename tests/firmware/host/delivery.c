/* Event delivery: subscriptions that change during a delivery, and the time a delivery takes (kernel.md §2,
 * openswarm.h). */
#include "test.h"

static bool once(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    deliveries++;
    return false;
}

TEST(a_handler_that_returns_false_is_unsubscribed, "kernel.md §1: false unsubscribes the handler")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, once, NULL);
    Sys_Subscribe_to_Event(E1, 0, count_delivery, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(deliveries, 3);
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
    Sys_Subscribe_to_Event(E1, 0, count_delivery, NULL);
    for (int i = 1; i <= 3; i++) {
        Sys_Send_IntEvent(E1, 1);
        Sys_Yield();
        CHECK_EQ(rounds_of_two[0], i);
        CHECK_EQ(rounds_of_two[1], i);
        CHECK_EQ(deliveries, i);
    }
    Sys_Unsubscribe_from_Event(E1, 0);
    CHECK_EQ(heap_now(), empty);
}

static bool subscribe_another(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)data;
    CHECK(Sys_Subscribe_to_Event(id, pid, count_delivery, NULL));
    return true;
}

TEST(a_handler_subscribed_during_a_delivery_gets_the_next_message, "openswarm.h: Sys_Subscribe_to_Event")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, subscribe_another, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(deliveries, 0);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(deliveries, 1);
}

static bool register_anew(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)data;
    CHECK(Sys_Unregister_Event(id) && Sys_Register_Event(id));
    CHECK(Sys_Subscribe_to_Event(id, pid, register_anew, NULL));
    CHECK(Sys_Subscribe_to_Event(id, pid, count_delivery, NULL));
    CHECK(++rounds_of_two[0] < 100);
    return true;
}

TEST(an_event_registered_again_by_its_handler_is_new, "openswarm.h: Sys_Unregister_Event")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, register_anew, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(rounds_of_two[0], 1);
    CHECK_EQ(deliveries, 0);
}

static bool resubscribe_and_hold(sys_event_data *data)
{
    (void)data;
    CHECK(++rounds_of_two[0] < 100);
    CHECK(Sys_Unsubscribe_Handler(E1, 0, count_delivery));
    CHECK(Sys_Subscribe_to_Event(E1, 0, count_delivery, resubscribe_and_hold));
    return true;
}

TEST(a_condition_that_subscribes_its_handler_again_gets_the_next_message, "openswarm.h: Sys_Subscribe_to_Event")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_delivery, resubscribe_and_hold);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(deliveries, 0);
    CHECK_EQ(rounds_of_two[0], 1);
}

TEST(an_event_without_listeners_allocates_nothing, "kernel.md §2")
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
    deliveries++;
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
        CHECK_EQ(deliveries, i);
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

static uint16 victim;
static bool kill_victim_when_asked(sys_event_data *data)
{
    (void)data;
    (void)Sys_Kill_Process(victim);
    return true;
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
