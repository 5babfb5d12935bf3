/* Options of the kernel: openswarm_mutex.h, _quota.h, _join.h, _cleanup.h, _service.h. */
#include "test.h"

#include "openswarm_cleanup.h"
#include "openswarm_join.h"
#include "openswarm_mutex.h"
#include "openswarm_quota.h"
#include "openswarm_service.h"

static uint16 start(void (*entry)(void *), const void *arg, uint8 priority)
{
    sys_process_config config = {entry, (void *)arg, 0, priority, 0, 0, 0};
    return Sys_Start_ProcessWith(&config);
}

/* Starts a kernel in which PID 0 has a higher priority than all threads, which it observes. */
static void boot_below(const sys_scheduler *scheduler)
{
    boot();
    os_system.priority = 9;
    Sys_Set_Scheduler(scheduler);
}

/* ---- Mutex ------------------------------------------------------------------------------------------------------ */

static sys_mutex mutex = SYS_MUTEX(3), other = SYS_MUTEX(5);

static void work(uint16 ms)
{
    while (ms-- != 0) {
        host_tick();
    }
}

static void low(void *unused)
{
    (void)unused;
    CHECK(Sys_Lock_Mutex(&mutex));
    note('(');
    work(5);
    note(')');
    CHECK(Sys_Unlock_Mutex(&mutex));
    note('l');
}

static void middle(void *unused)
{
    (void)unused;
    Sys_Sleep(2);
    note('m');
    work(2000);
    note('M');
}

static void high(void *unused)
{
    (void)unused;
    Sys_Sleep(2);
    note('h');
    CHECK(Sys_Lock_Mutex(&mutex));
    note('H');
    CHECK(Sys_Unlock_Mutex(&mutex));
}

TEST(a_ceiling_bounds_priority_inversion, "openswarm_mutex.h: one section of a lower thread; it was 2,012 ms")
{
    boot_below(&sys_fixed_priority);
    start(low, NULL, 1);
    start(middle, NULL, 2);
    start(high, NULL, 3);
    Sys_Sleep(10);
    CHECK(strcmp(trace, "()hHm") == 0);
    Sys_Sleep(3000);
    CHECK(strcmp(trace, "()hHmMl") == 0);
}

static void take_turn(void *c)
{
    CHECK(Sys_Lock_Mutex(&mutex));
    note(*(const char *)c);
    Sys_Sleep(3);
    CHECK(Sys_Unlock_Mutex(&mutex));
}

TEST(a_mutex_goes_to_the_best_waiter_and_to_the_first_of_equal_ones, "openswarm_mutex.h")
{
    boot_below(&sys_fixed_priority);
    start(take_turn, "a", 1);
    Sys_Sleep(1);
    start(take_turn, "b", 1);
    start(take_turn, "c", 1);
    Sys_Sleep(1);
    start(take_turn, "d", 2);
    Sys_Sleep(30);
    CHECK(strcmp(trace, "adbc") == 0);
    CHECK(mutex.owner == NULL && mutex.waiters == NULL);
}

static void try_for_a_while(void *unused)
{
    (void)unused;
    CHECK(!Sys_Lock_MutexTimeout(&mutex, 1));
    CHECK_EQ(Sys_Get_LastError(), SYS_OK);
    note('t');
    CHECK(Sys_Lock_MutexTimeout(&mutex, 50));
    note('g');
    CHECK(Sys_Unlock_Mutex(&mutex));
}

TEST(a_lock_may_time_out, "openswarm_mutex.h: Sys_Lock_MutexTimeout")
{
    boot_below(&sys_round_robin);
    start(take_turn, "a", 1);
    Sys_Yield();
    start(try_for_a_while, NULL, 1);
    Sys_Sleep(20);
    CHECK(strcmp(trace, "atg") == 0);
}

static void misuse(void *unused)
{
    (void)unused;
    CHECK(!Sys_Unlock_Mutex(&mutex));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_PROCESS);
    CHECK(Sys_Lock_Mutex(&mutex));
    CHECK(!Sys_Lock_Mutex(&mutex));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_PROCESS);
    CHECK_EQ(os_running->priority, 3);
    CHECK(Sys_Lock_Mutex(&other));
    CHECK_EQ(os_running->priority, 5);
    CHECK(Sys_Unlock_Mutex(&mutex)); /* unlocked in the order of locking, not in reverse */
    CHECK_EQ(os_running->priority, 5);
    CHECK(Sys_Unlock_Mutex(&other));
    CHECK_EQ(os_running->priority, 2);
    Sys_Start_CriticalSection();
    CHECK(!Sys_Lock_Mutex(&mutex));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_CONTEXT);
    Sys_End_CriticalSection();
    note('.');
}

TEST(mutexes_refuse_what_they_cannot_do, "openswarm_mutex.h: errors, ceilings of several")
{
    boot_below(&sys_fixed_priority);
    start(misuse, NULL, 2);
    Sys_Sleep(1);
    CHECK(strcmp(trace, ".") == 0);
    CHECK(!Sys_Lock_Mutex(&mutex)); /* the priority of PID 0 is above the ceiling */
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
}

static void keep_result_and_lock(void *unused)
{
    (void)unused;
    sys_event_data *data = Sys_Wait_for_Event(E1);
    CHECK(Sys_Lock_Mutex(&mutex));
    CHECK_EQ(data->value, 7);
    note('k');
    CHECK(Sys_Unlock_Mutex(&mutex));
    Sys_Clear_EventData(&data);
    CHECK(data == NULL);
}

TEST(a_lock_leaves_the_wait_result, "openswarm_mutex.h: Sys_Lock_Mutex")
{
    boot_below(&sys_round_robin);
    Sys_Register_Event(E1);
    uint16 empty = heap_now();
    start(take_turn, "a", 1);
    start(keep_result_and_lock, NULL, 1);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 7);
    Sys_Sleep(10);
    CHECK(strcmp(trace, "ak") == 0);
    CHECK_EQ(heap_now(), empty);
}

/* ---- Quotas ---------------------------------------------------------------------------------------------- */

static uint16 newest;
static bool slow_handler(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    static bool half;
    newest = data->value;
    work(half ? 2 : 1); /* 1.5 ms */
    half = !half;
    deliveries++;
    return true;
}

static void command(void *count)
{
    for (;;) {
        ++*(uint16 *)count;
        work(1);
        (void)Sys_Wait_for_Period();
    }
}

TEST(the_latest_value_keeps_a_slow_handler_from_filling_the_heap, "openswarm_quota.h: 1.5 ms of work every ms, 10 s")
{
    static sys_quota ticks;
    static uint16 commands;
    boot();
    CHECK(Sys_Keep_Latest(&ticks, SYS_1ms_TIMER));
    sys_process_config config = {command, &commands, 0, 0, SYS_PERIODIC, 10, 10};
    CHECK(Sys_Start_ProcessWith(&config) != 0);
    CHECK(Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, slow_handler, NULL));
    uint16 before = heap_now();
    Sys_Sleep(10000);
    CHECK(commands >= 990 && commands <= 1010);
    CHECK_EQ(Sys_Get_Statistics()->events_lost, 0);
    CHECK(Sys_Get_Statistics()->heap_peak - before <= 64);
    CHECK(deliveries >= 5000);
}

TEST(the_newest_value_wins, "openswarm_quota.h: Sys_Keep_Latest")
{
    static sys_quota latest;
    boot();
    Sys_Register_Event(E1);
    Sys_Register_Event(E1 + 8); /* event in the same hash bucket */
    CHECK(Sys_Keep_Latest(&latest, E1));
    Sys_Subscribe_to_Event(E1, 0, slow_handler, NULL);
    Sys_Subscribe_to_Event(E1 + 8, 0, count_delivery, NULL);
    for (uint16 value = 1; value <= 50; value++) {
        CHECK(Sys_Send_IntEvent(E1, value));
    }
    CHECK(Sys_Send_IntEvent(E1 + 8, 1));
    Sys_Yield();
    CHECK_EQ(newest, 50);
    CHECK_EQ(deliveries, 2);
    CHECK_EQ(latest.dropped, 0);
    CHECK(!Sys_Send_IntEvent(E1 + 16, 1)); /* the quota's list element must not pass for an event of the bucket */
    CHECK(!Sys_Keep_Latest(&latest, E_NEVER));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_EVENT);
}

/* ---- Join and zombies ------------------------------------------------------------------------------------ */

static void ends_in_3_ms(void *unused)
{
    (void)unused;
    Sys_Sleep(3);
}

static void joins(void *pid)
{
    CHECK(Sys_Join(*(const uint16 *)pid));
    note('j');
}

TEST(a_joinable_thread_stays_as_zombie_until_it_is_joined, "openswarm_join.h; the paper: five process states")
{
    sys_process_config config = {ends_in_3_ms, NULL, 0, 0, 0, 0, 0};
    boot();
    Sys_Subscribe_to_Event(SYS_EVENT_TERMINATION, 0, count_delivery, NULL);
    uint16 empty = heap_now(), pid = Sys_Start_Joinable(&config);
    Sys_Sleep(5);
    CHECK_EQ(Sys_Get_ProcessState(pid), SYS_ZOMBIE);
    CHECK_EQ(deliveries, 1);
    CHECK_EQ(heap_now() - empty, sizeof(sys_pcb));
    CHECK(Sys_Join(pid));
    CHECK_EQ(Sys_Get_ProcessState(pid), SYS_UNKNOWN);
    CHECK_EQ(heap_now(), empty);
    CHECK(!Sys_Join(pid));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_PROCESS);
    pid = Sys_Start_Joinable(&config);
    CHECK(Sys_Kill_Process(pid));
    CHECK_EQ(Sys_Get_ProcessState(pid), SYS_ZOMBIE);
    CHECK(Sys_Kill_Process(pid));
    CHECK_EQ(Sys_Get_ProcessState(pid), SYS_UNKNOWN);
    CHECK_EQ(Sys_Get_UnusedStack(pid), 0);
    Sys_Yield();
    CHECK_EQ(heap_now(), empty);
}

TEST(join_waits_for_any_thread, "openswarm_join.h: Sys_Join")
{
    sys_process_config config = {ends_in_3_ms, NULL, 0, 0, 0, 0, 0};
    boot();
    uint16 empty = heap_now(), plain = Sys_Start_ProcessWith(&config), joinable = Sys_Start_Joinable(&config);
    CHECK(start(joins, &plain, 0) != 0 && start(joins, &plain, 0) != 0);
    uint16 killed = start(joins, &joinable, 0);
    Sys_Sleep(1);
    CHECK(Sys_Kill_Process(killed));
    CHECK(Sys_Join(joinable));
    CHECK_EQ(Sys_Get_SystemTime(), 3);
    Sys_Sleep(1);
    CHECK(strcmp(trace, "jj") == 0);
    CHECK(!Sys_Join(0));
    CHECK_EQ(heap_now(), empty);
}

/* ---- Services -------------------------------------------------------------------------------------------- */

static uint16 starts, feedings;
static void hangs_after_three(void *unused)
{
    (void)unused;
    starts++;
    for (int i = 0; i < 3; i++) {
        CHECK(Sys_Feed_Watchdog());
        feedings++;
        Sys_Sleep(5);
    }
    for (;;) {
        Sys_Sleep(1000);
    }
}

TEST(a_service_that_hangs_is_restarted, "openswarm_service.h: limit_ms, restarts")
{
    static const sys_process_config config = {hangs_after_three, NULL, 0, 0, 0, 0, 0};
    static sys_service service = {.config = &config, .limit_ms = 20, .restarts = 2};
    boot();
    CHECK(!Sys_Feed_Watchdog());
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_PROCESS);
    CHECK(Sys_Start_Service(&service));
    Sys_Sleep(28); /* the watchdog was last fed at 10 ms */
    CHECK_EQ(starts, 1);
    Sys_Sleep(7);
    CHECK_EQ(starts, 2);
    CHECK_EQ(service.bitten, 1);
    Sys_Sleep(500);
    CHECK_EQ(starts, 3);
    CHECK_EQ(feedings, 9);
    CHECK_EQ(service.bitten, 3);
    CHECK_EQ(service.pid, 0);
}
