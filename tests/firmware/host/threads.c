/* Threads: PIDs, configurations, sleeping, and the end of a thread (kernel.md §2 and §3, openswarm.h). */
#include "test.h"

static uint16 ended[3];
static bool on_termination(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    CHECK_EQ(Sys_Get_ProcessState(data->value), SYS_UNKNOWN);
    ended[deliveries++] = data->value;
    return true;
}
static void returns_at_once(void)
{
}

TEST(the_end_of_every_thread_is_reported, "openswarm.h: SYS_EVENT_TERMINATION")
{
    boot();
    Sys_Subscribe_to_Event(SYS_EVENT_TERMINATION, 0, on_termination, NULL);
    uint16 before = heap_now(), returns = Sys_Start_Process(returns_at_once), killed = Sys_Start_Process(yield_for_ever);
    Sys_Yield();
    CHECK(Sys_Kill_Process(killed));
    Sys_Yield();
    CHECK_EQ(deliveries, 2);
    CHECK_EQ(ended[0], returns);
    CHECK_EQ(ended[1], killed);
    CHECK_EQ(heap_now(), before);
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
    uint16 old = Sys_Start_Process(yield_for_ever);
    for (long i = 0; i < 65600; i++) {
        uint16 pid = Sys_Start_Process(yield_for_ever);
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
