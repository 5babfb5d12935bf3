/* Sweeps over a scenario that uses every structural call: a preemption at each unlock, an interrupt that sends at each
 * unlock, and a failure of the k-th allocation for each k. */
#include "test.h"

static int delivered, sent_extra, worker_rounds;

static bool listener(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    CHECK(data->size == 0 || data->payload != NULL);
    delivered++;
    return true;
}

static void worker(void)
{
    for (int i = 0; i < 2; i++) {
        sys_event_data *data = Sys_Wait_for_ConditionTimeout(E2, NULL, 3);
        worker_rounds++;
        Sys_Clear_EventData(&data);
    }
}

static void spinner(void)
{
    for (;;) {
        Sys_Sleep(1);
    }
}

/* Undoes all its changes before it returns. Each failing call must have reported its error. */
static void scenario(void)
{
    Sys_Register_Event(E1);
    Sys_Register_Event(E2);
    uint16 w = Sys_Start_Process(worker), s = Sys_Start_Process(spinner);
    Sys_Subscribe_to_Event(E1, 0, listener, NULL);
    if (s != 0) {
        Sys_Subscribe_to_Event(E1, s, listener, NULL);
    }
    Sys_Send_Event(E1, "payload", 7);
    Sys_Yield();
    Sys_Send_IntEvent(E2, 1);
    Sys_Sleep(10);
    if (s != 0) {
        CHECK(Sys_Kill_Process(s));
    }
    Sys_Send_IntEvent(E1, 2);
    Sys_Yield();
    Sys_Unsubscribe_Handler(E1, 0, listener);
    if (w != 0) {
        CHECK_EQ(Sys_Get_ProcessState(w), SYS_UNKNOWN);
    }
    Sys_Unregister_Event(E2);
    Sys_Unregister_Event(E1);
    Sys_Yield();
}

static void preempt(void)
{
    host_slice();
}
static void send_extra(void)
{
    if (Sys_Send_IntEvent(E1, 9)) {
        sent_extra++;
    }
}
static void interrupt(void)
{
    host_device(send_extra);
    host_tick();
}

static void sweep(void (*hook)(void))
{
    boot();
    uint16 empty = heap_now();
    unsigned long start = host_unlocks();
    scenario();
    unsigned long points = host_unlocks() - start;
    CHECK(points > 60);
    CHECK_EQ(heap_now(), empty);
    int usual = delivered;
    CHECK_EQ(usual, 3);
    for (unsigned long n = 1; n <= points + 5; n++) {
        delivered = sent_extra = worker_rounds = 0;
        host_at_unlock(n, hook);
        scenario();
        host_at_unlock(0, NULL);
        CHECK(lists_are_well_formed());
        CHECK_EQ(heap_now(), empty);
        CHECK_EQ(worker_rounds, 2);
        CHECK(delivered >= usual && delivered <= usual + 2 * sent_extra);
    }
}

TEST(a_preemption_at_every_unlock_changes_nothing, "on posix: no lost or doubled event, memory conserved")
{
    sweep(preempt);
}

TEST(an_interrupt_at_every_unlock_changes_nothing, "on posix: an ISR that sends, and the clock")
{
    sweep(interrupt);
}

TEST(the_failure_of_any_allocation_is_reported_and_harmless, "the k-th allocation failing for every k")
{
    boot();
    uint16 empty = heap_now();
    unsigned long start = host_allocations();
    scenario();
    unsigned long total = host_allocations() - start;
    CHECK(total >= 9);
    for (unsigned long k = 1; k <= total; k++) {
        uint16 lost = Sys_Get_Statistics()->events_lost;
        Sys_Send_IntEvent(E_NEVER, 0);
        CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_EVENT);
        host_fail_allocation(k);
        scenario();
        host_fail_allocation(0);
        CHECK_EQ(heap_now(), empty);
        CHECK(lists_are_well_formed());
        CHECK(Sys_Get_Statistics()->events_lost - lost <= 1);
    }
    CHECK(Sys_Get_Statistics()->events_lost >= 3);
}

static void sleeper(void)
{
    Sys_Sleep(1);
}

TEST(losses_are_counted_per_event, "Sys_Get_LostEvents")
{
    boot();
    for (uint16 e = E1; e <= E4; e++) {
        Sys_Register_Event(e);
        Sys_Subscribe_to_Event(e, 0, listener, NULL);
    }
    for (int i = 0; i < 6; i++) {
        host_fail_allocation(1);
        CHECK(!Sys_Send_IntEvent(i < 4 ? E2 : E3, 1));
        CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_MEMORY);
    }
    CHECK_EQ(Sys_Get_LostEvents(E2), 4);
    CHECK_EQ(Sys_Get_LostEvents(E3), 2);
    CHECK_EQ(Sys_Get_LostEvents(E1), 0);
    CHECK_EQ(Sys_Get_Statistics()->events_lost, 6);
    Sys_Unregister_Event(E2);
    CHECK_EQ(Sys_Get_LostEvents(E2), 4);
    host_fail_allocation(1);
    CHECK_EQ(Sys_Start_Process(sleeper), 0);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_MEMORY);
}
