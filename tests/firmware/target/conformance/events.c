/* Events: registration, subscription, sending, delivery, waiting, memory. */
#include "conformance.h"

#include <string.h>

#define FILE_LETTER 'e'

static uint16 calls, sum;
static bool count(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    calls++;
    sum = (uint16)(sum + data->value);
    return true;
}

static bool once(uint16 pid, uint16 event, sys_event_data *data)
{
    return count(pid, event, data) && false;
}

static bool blocks(uint16 pid, uint16 event, sys_event_data *data)
{
    uint16 refused = Sys_Get_Statistics()->refused;
    Sys_Yield();
    Sys_Sleep(10);
    if (Sys_Get_Statistics()->refused == refused + 2u && Sys_Wait_for_Event(E2) == NULL) {
        note('r');
    }
    return count(pid, event, data);
}

static void registration(void)
{
    uint16 heap = heap_now();
    CHECK(!Sys_IsEventRegistered(E1) && !Sys_Send_IntEvent(E1, 1) && Sys_Get_LastError() == SYS_ERROR_EVENT);
    CHECK(Sys_Register_Event(E1) && Sys_Register_Event(E1) && Sys_IsEventRegistered(E1));
    uint16 with = heap_now();
    CHECK(Sys_Send_IntEvent(E1, 1)); /* without subscriber the message is not stored */
    CHECK(heap_now() == with);
    CHECK(!Sys_Subscribe_to_Event(E1, 0, NULL, NULL) && Sys_Get_LastError() == SYS_ERROR_ARGUMENT);
    CHECK(!Sys_Subscribe_to_Event(E_NEVER, 0, count, NULL) && Sys_Get_LastError() == SYS_ERROR_EVENT);
    CHECK(!Sys_Subscribe_to_Event(E1, 60000, count, NULL) && Sys_Get_LastError() == SYS_ERROR_PROCESS);
    CHECK(Sys_Unregister_Event(E1) && !Sys_Unregister_Event(E1));
    CHECK(heap_now() == heap);
}

static void handlers_run_between_threads(void)
{
    calls = 0;
    forget();
    CHECK(Sys_Register_Event(E1));
    uint16 heap = heap_now();
    CHECK(Sys_Subscribe_to_Event(E1, 0, once, NULL) && Sys_Subscribe_to_Event(E1, 0, blocks, NULL));
    CHECK(Sys_Send_IntEvent(E1, 1) && calls == 0);
    Sys_Yield();
    CHECK(calls == 2 && noted("r"));
    CHECK(Sys_Send_IntEvent(E1, 1));
    Sys_Yield();
    CHECK(calls == 3); /* the handler has returned false: unsubscribed */
    CHECK(!Sys_Unsubscribe_Handler(E1, 0, once) && Sys_Unsubscribe_from_Event(E1, 0));
    CHECK(heap_now() == heap);
    CHECK(Sys_Unregister_Event(E1));
}

static uint8 sent[40];
static bool compare(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    calls += data->size <= sizeof sent && memcmp(data->payload, sent, data->size) == 0;
    sum = (uint16)(sum + data->size);
    uint16 first = data->size == 0 ? 0 : sent[0];
    return data->value == (data->size < 2 ? first : (uint16)(first | sent[1] << 8));
}

static void payloads_arrive_whole(void)
{
    calls = sum = 0;
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, compare, NULL));
    for (uint8 i = 0; i < sizeof sent; i++) {
        sent[i] = (uint8)(i * 7 + 3);
    }
    for (uint8 size = 0; size <= sizeof sent; size++) {
        CHECK(Sys_Send_Event(E1, sent, size));
        Sys_Yield();
    }
    CHECK(calls == sizeof sent + 1 && sum == sizeof sent * (sizeof sent + 1) / 2);
    CHECK(Sys_Unsubscribe_Handler(E1, 0, compare)); /* this handler has never returned false */
    CHECK(Sys_Unregister_Event(E1));
}

static void wait_for_e2(void *unused)
{
    (void)unused;
    sys_event_data *data = Sys_Wait_for_Event(E2);
    note(data != NULL && data->size == 5 && memcmp(data->payload, "event", 5) == 0 ? 'w' : '?');
    Sys_Clear_EventData(&data);
    data = Sys_Wait_for_ConditionTimeout(E2, NULL, 7);
    note(data == NULL && Sys_Get_LastError() == SYS_OK ? 't' : '?');
}

static void waits_and_timeouts(void)
{
    uint16 heap = heap_now();
    forget();
    CHECK(Sys_Register_Event(E2) && start(wait_for_e2, NULL, 0) != 0 && start(wait_for_e2, NULL, 0) != 0);
    Sys_Sleep(1);
    CHECK(Sys_Send_Event(E2, "event", 5));
    Sys_Sleep(30);
    CHECK(noted("wwtt"));
    CHECK(Sys_Unregister_Event(E2));
    CHECK(heap_now() == heap);
}

static bool odd(sys_event_data *data)
{
    return data->value % 2 != 0;
}

static void wait_for_odd(void *unused)
{
    (void)unused;
    const sys_event_data *data = Sys_Wait_for_Condition(E1, odd);
    note(data != NULL && data->value == 3 ? '3' : '?');
    data = Sys_Wait_for_Event(E1); /* frees the first result */
    note(data != NULL && data->value == 4 ? '4' : '?');
    /* returns without clearing: the end frees the result */
}

static void a_thread_owns_one_result(void)
{
    forget();
    CHECK(Sys_Register_Event(E1));
    uint16 heap = heap_now();
    CHECK(start(wait_for_odd, NULL, 0) != 0);
    Sys_Sleep(1);
    CHECK(Sys_Send_IntEvent(E1, 2) && Sys_Send_IntEvent(E1, 3));
    Sys_Sleep(1);
    CHECK(Sys_Send_IntEvent(E1, 4));
    Sys_Sleep(1);
    CHECK(noted("34"));
    CHECK(heap_now() == heap);
    uint16 pid = start(wait_for_odd, NULL, 0);
    Sys_Sleep(1);
    CHECK(Sys_Send_IntEvent(E1, 3));
    CHECK(Sys_Kill_Process(pid)); /* while a message to the thread is queued */
    Sys_Sleep(1);
    CHECK(heap_now() == heap);
    pid = start(wait_for_odd, NULL, 0);
    Sys_Sleep(1);
    CHECK(Sys_Send_IntEvent(E1, 3));
    Sys_Sleep(1);
    CHECK(Sys_Kill_Process(pid)); /* while the thread owns a result */
    CHECK(heap_now() == heap);
    CHECK(Sys_Unregister_Event(E1));
}

static uint16 victim;
static bool kill_victim(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    note(Sys_Kill_Process(victim) ? 'k' : '?');
    return false;
}
static bool kill_own_thread(sys_event_data *data)
{
    (void)data;
    return Sys_Kill_Process(victim);
}
static void wait_and_be_killed(void *unused)
{
    (void)unused;
    (void)Sys_Wait_for_Condition(E1, kill_own_thread);
    note('!');
}
static void spin(void *unused)
{
    (void)unused;
    for (;;) {
        (void)Sys_Get_SystemTime();
    }
}

static void a_thread_may_die_under_a_delivery(void)
{
    calls = 0;
    forget();
    CHECK(Sys_Register_Event(E1));
    uint16 heap = heap_now();
    victim = start(spin, NULL, 0);
    CHECK(Sys_Subscribe_to_Event(E1, 0, kill_victim, NULL) && Sys_Subscribe_to_Event(E1, victim, count, NULL));
    CHECK(Sys_Send_IntEvent(E1, 1));
    Sys_Sleep(30);
    CHECK(noted("k") && calls == 0);
    victim = start(wait_and_be_killed, NULL, 0);
    Sys_Sleep(1);
    CHECK(Sys_Send_IntEvent(E1, 1));
    Sys_Sleep(1);
    CHECK(noted("k") && Sys_Get_ProcessState(victim) == SYS_UNKNOWN);
    CHECK(heap_now() == heap);
    CHECK(Sys_Unregister_Event(E1));
}

static bool unregister(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)Sys_Unregister_Event(event);
    return count(pid, event, data);
}
static void wait_for_gone(void *unused)
{
    (void)unused;
    const sys_event_data *data = Sys_Wait_for_Event(E1);
    note(data == NULL && Sys_Get_LastError() == SYS_ERROR_EVENT ? 'g' : '?');
}

static void an_event_may_end_in_its_handler(void)
{
    uint16 heap = heap_now();
    calls = 0;
    forget();
    CHECK(Sys_Register_Event(E1) && start(wait_for_gone, NULL, 0) != 0);
    Sys_Sleep(1);
    CHECK(Sys_Subscribe_to_Event(E1, 0, unregister, NULL) && Sys_Subscribe_to_Event(E1, 0, count, NULL));
    CHECK(Sys_Send_IntEvent(E1, 1) && Sys_Send_IntEvent(E1, 2));
    Sys_Sleep(2);
    CHECK(calls == 1 && noted("g") && !Sys_IsEventRegistered(E1));
    CHECK(heap_now() == heap);
}

static bool resend(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)Sys_Send_IntEvent(event, data->value);
    return count(pid, event, data);
}

static void a_handler_that_resends_starves_nobody(void)
{
    calls = 0;
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, resend, NULL) && Sys_Send_IntEvent(E1, 1));
    uint32 before = Sys_Get_SystemTime();
    while (Sys_Get_SystemTime() - before < 5) {
        Sys_Yield();
    }
    CHECK(calls > 1);
    CHECK(Sys_Unregister_Event(E1));
}

static uint16 last_tick, gaps;
static bool follow(uint16 pid, uint16 event, sys_event_data *data)
{
    gaps += calls != 0 && data->value != (uint16)(last_tick + 1u);
    last_tick = data->value;
    return count(pid, event, data);
}

/* Changes event and subscription lists while the clock interrupt may traverse them. */
static void no_tick_is_lost_while_lists_change(void)
{
    Sys_Yield(); /* until messages of the previous check are delivered */
    uint16 heap = heap_now(), wrong = 0;
    calls = gaps = 0;
    CHECK(Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, follow, NULL));
    uint32 begin = Sys_Get_SystemTime();
    while (Sys_Get_SystemTime() - begin < 400) {
        wrong += !Sys_Register_Event(E3) || !Sys_Register_Event(SYS_1ms_TIMER + 64); /* event in the same hash bucket */
        wrong += !Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, once, NULL);
        wrong += !Sys_Subscribe_to_Event(E3, 0, count, odd);
        wrong += !Sys_Unregister_Event(E3) || !Sys_Unregister_Event(SYS_1ms_TIMER + 64);
        (void)Sys_Unsubscribe_Handler(SYS_1ms_TIMER, 0, once);
        Sys_Yield();
    }
    CHECK(wrong == 0 && gaps == 0);
    CHECK(calls >= 398);
    CHECK(Sys_Unsubscribe_Handler(SYS_1ms_TIMER, 0, follow));
    Sys_Yield();
    CHECK(heap_now() == heap);
}

/* Events exhaust the memory: the failure is reported and all memory is freed afterwards. */
static void exhaustion_is_reported(void)
{
    uint16 heap = heap_now(), made = 0;
    while (made < 8000 && Sys_Register_Event((uint16)(1000 + made))) {
        made++;
    }
    CHECK(made > 10 && made < 8000);
    CHECK(Sys_Get_LastError() == SYS_ERROR_MEMORY);
    while (made > 0) {
        made--;
        (void)Sys_Unregister_Event((uint16)(1000 + made));
    }
    CHECK(heap_now() == heap);
}

/* Main's subscriptions end, those of the drivers stay. */
static void drivers_have_an_owner_of_their_own(void)
{
    CHECK(!Sys_Unsubscribe_from_Event(SYS_LEFTMOTOR_SPEED, 0) && Sys_Get_LastError() == SYS_ERROR_PROCESS);
    CHECK(Sys_Subscribe_to_Event(SYS_LEFTMOTOR_SPEED, 0, count, NULL));
    CHECK(Sys_Unsubscribe_from_Event(SYS_LEFTMOTOR_SPEED, 0));
    bool any = false;
    for (uint16 pid = 0xFFF0; pid != 0; pid++) { /* the drivers' own identity is among them */
        any |= Sys_Unsubscribe_from_Event(SYS_LEFTMOTOR_SPEED, pid) || Sys_Unsubscribe_Handler(SYS_LEFTMOTOR_SPEED, pid, NULL) ||
               Sys_Subscribe_to_Event(SYS_LEFTMOTOR_SPEED, pid, count, NULL);
    }
    CHECK(!any && Sys_Get_LastError() == SYS_ERROR_PROCESS);
    CHECK(Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 20));
    Sys_Yield();
    CHECK(Sys_Get_MotorSpeed_Left() == 20 && Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 0));
    Sys_Yield();
    CHECK(Sys_Get_MotorSpeed_Left() == 0);
}

void check_events(void)
{
    drivers_have_an_owner_of_their_own();
    registration();
    handlers_run_between_threads();
    payloads_arrive_whole();
    waits_and_timeouts();
    a_thread_owns_one_result();
    a_thread_may_die_under_a_delivery();
    an_event_may_end_in_its_handler();
    a_handler_that_resends_starves_nobody();
    no_tick_is_lost_while_lists_change();
    exhaustion_is_reported();
}
