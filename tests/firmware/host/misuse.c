/* SPDX-License-Identifier: MIT */
/* Handlers, timers, services and schedulers that change what the kernel is walking over; calls and numbers at their limits.
 * Afterwards no memory is lost and the kernel continues. */
#include "test.h"

#include "openswarm_cleanup.h"
#include "openswarm_join.h"
#include "openswarm_mutex.h"
#include "openswarm_notification.h"
#include "openswarm_quota.h"
#include "openswarm_semaphore.h"
#include "openswarm_service.h"
#include "openswarm_timer.h"

static sys_mutex mutex = SYS_MUTEX(9);
static sys_semaphore semaphore = SYS_SEMAPHORE(0);
static sys_notification notification;
static sys_timer timer;
static sys_quota quota;
static sys_cleanup cleanup;
static uint16 victim;

static void two_ms(void *unused)
{
    (void)unused;
    Sys_Sleep(2);
}

/* ---- Handlers that change what is being delivered ------------------------------------------------------------------ */

static bool register_again(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)data;
    CHECK(Sys_Unregister_Event(id) && Sys_Register_Event(E2) && Sys_Register_Event(id));
    CHECK(Sys_Subscribe_to_Event(E2, pid, count_delivery, NULL));
    CHECK(Sys_Subscribe_to_Event(id, pid, count_delivery, NULL));
    CHECK(Sys_Send_IntEvent(id, 7) && Sys_Send_IntEvent(E2, 8));
    return false;
}

TEST(an_event_whose_block_is_used_again_during_its_delivery, "openswarm.h: Sys_Unregister_Event")
{
    boot();
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, register_again, NULL));
    uint16 before = heap_now();
    CHECK(Sys_Send_IntEvent(E1, 1) && Sys_Send_IntEvent(E1, 2)); /* the second is dropped with its event */
    Sys_Sleep(3);
    CHECK_EQ(deliveries, 2);
    CHECK(Sys_Unregister_Event(E2));
    CHECK_EQ(heap_now(), before);
}

static bool unregister_in_condition(sys_event_data *data)
{
    (void)data;
    CHECK(Sys_Unregister_Event(E1) && Sys_Register_Event(E1));
    return true;
}

static void wait_with_condition(void *unused)
{
    (void)unused;
    const sys_event_data *data = Sys_Wait_for_Condition(E1, unregister_in_condition);
    note(data == NULL && Sys_Get_LastError() == SYS_ERROR_EVENT ? 'e' : '?');
}

static void wait_plainly(void *unused)
{
    (void)unused;
    note(Sys_Wait_for_Event(E1) == NULL ? 'n' : '?');
}

TEST(a_condition_that_unregisters_its_event_wakes_all_without_data, "openswarm.h: Sys_Wait_for_Event, NULL")
{
    boot();
    Sys_Register_Event(E1);
    uint16 empty = heap_now();
    CHECK(start_thread(wait_plainly, NULL) != 0 && start_thread(wait_with_condition, NULL) != 0 && start_thread(wait_plainly, NULL) != 0);
    Sys_Sleep(2);
    CHECK(Sys_Send_IntEvent(E1, 1));
    Sys_Sleep(5);
    CHECK_EQ(strlen(trace), 3);
    CHECK(strchr(trace, '?') == NULL);
    CHECK_EQ(heap_now(), empty);
}

/* ---- Time-outs ------------------------------------------------------------------------------------------------- */

static uint16 helper;
static void join_helper(void *ms)
{
    note(Sys_JoinTimeout(helper, *(const uint16 *)ms) ? 'j' : Sys_Get_LastError() == SYS_OK ? 't' : 'e');
}

TEST(time_outs_and_ends_of_the_same_tick, "openswarm_join.h, openswarm_mutex.h: a time-out is no failure, and happens once")
{
    static const uint16 ms[] = {1, 2, 3};
    static const sys_process_config config = {.entry = two_ms};
    boot();
    uint16 empty = heap_now();
    for (int round = 0; round < 3; round++) {
        helper = Sys_Start_Joinable(&config);
        for (int i = 0; i < 3; i++) {
            CHECK(start_thread(join_helper, &ms[i]) != 0);
        }
        Sys_Sleep(6);
        if (Sys_Get_ProcessState(helper) == SYS_ZOMBIE) {
            CHECK(Sys_Kill_Process(helper));
        }
        Sys_Sleep(1);
        CHECK_EQ(strlen(trace), 3 * (round + 1));
        CHECK(strchr(trace, 'e') == NULL && trace[3 * round] == 't' && trace[3 * round + 2] == 'j');
        CHECK_EQ(heap_now(), empty);
    }
}

/* ---- Timers ------------------------------------------------------------------------------------------------------- */

static bool restart_timer(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid;
    deliveries++;
    if (data->value == 3) {
        CHECK(Sys_Stop_Timer(&timer) && !Sys_Stop_Timer(&timer));
        return true;
    }
    CHECK(Sys_Start_Timer(&timer, id, (uint16)(data->value + 1), 2, 1));
    return true;
}

TEST(a_timer_is_started_and_stopped_by_its_own_handler, "openswarm_timer.h")
{
    boot();
    Sys_Register_Event(E1);
    CHECK(Sys_Subscribe_to_Event(E1, 0, restart_timer, NULL));
    CHECK(Sys_Start_Timer(&timer, E1, 0, 1, 0));
    Sys_Sleep(50);
    CHECK_EQ(deliveries, 4);
    CHECK(Sys_Start_Timer(&timer, E1, 9, 1, 1));
    CHECK(Sys_Unregister_Event(E1)); /* the timer continues without an event */
    uint16 lost = Sys_Get_Statistics()->events_lost;
    Sys_Sleep(20);
    CHECK_EQ(Sys_Get_Statistics()->events_lost, lost);
    CHECK(Sys_Stop_Timer(&timer));
    CHECK(!Sys_Start_Timer(&timer, E1, 0, 0, 1) && !Sys_Start_Timer(&timer, E1, 0, 32768u, 1));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
}

/* ---- Services ----------------------------------------------------------------------------------------------------- */

static sys_service services[2];
static int begun[2];

static void end_other_service(void *number)
{
    uint16 pid = services[1 - *(const int *)number].pid;
    note(pid != 0 && Sys_Kill_Process(pid) ? 'k' : 'f');
}

static void hang_with_mutex(void *number)
{
    static sys_cleanup own[2];
    int which = *(const int *)number;
    begun[which]++;
    CHECK(Sys_Push_Cleanup(&own[which], end_other_service, number));
    (void)Sys_Lock_Mutex(&mutex);
    for (;;) {
        Sys_Sleep(1000);
    }
}

TEST(services_bitten_in_the_same_tick_whose_cleanups_kill_each_other, "openswarm_service.h: restarts; mutexes are handed on")
{
    static const int number[] = {0, 1};
    static const sys_process_config configs[] = {
        {.entry = hang_with_mutex, .arg = (void *)&number[0]}, {.entry = hang_with_mutex, .arg = (void *)&number[1]}};
    boot();
    uint16 empty = heap_now();
    for (int i = 0; i < 2; i++) {
        services[i] = (sys_service){.config = &configs[i], .limit_ms = 5, .restarts = 3};
        CHECK(Sys_Start_Service(&services[i]));
        CHECK(!Sys_Start_Service(&services[i]));
        CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_PROCESS);
    }
    Sys_Sleep(200);
    CHECK(begun[0] == 4 && begun[1] == 4);
    CHECK(services[0].pid == 0 && services[1].pid == 0);
    CHECK(mutex.owner == NULL && mutex.waiters == NULL);
    CHECK(lists_are_well_formed());
    CHECK_EQ(heap_now(), empty);
}

/* ---- Shared results ------------------------------------------------------------------------------------------------ */

static sys_event_data *shared[2];
static void share_result(void *number)
{
    int which = *(const int *)number;
    shared[which] = Sys_Wait_for_Event(E1);
    Sys_Sleep(5);
    sys_event_data *twice = shared[which];
    Sys_Clear_EventData(&shared[1 - which]); /* the other's variable, the same block */
    Sys_Clear_EventData(&twice);
    Sys_Clear_EventData(&twice);
    sleep_for_ever(NULL);
}

TEST(a_result_that_two_threads_share_and_clear_for_each_other, "openswarm.h: Sys_Clear_EventData frees a result once")
{
    static const int number[] = {0, 1};
    uint16 pids[2];
    boot();
    Sys_Register_Event(E1);
    uint16 empty = heap_now();
    for (int i = 0; i < 2; i++) {
        pids[i] = start_thread(share_result, &number[i]);
    }
    Sys_Sleep(1);
    CHECK(Sys_Send_IntEvent(E1, 0x55AA));
    Sys_Sleep(10);
    CHECK(Sys_Kill_Process(pids[0]) && Sys_Kill_Process(pids[1]));
    Sys_Sleep(1);
    CHECK_EQ(heap_now(), empty);
}

#ifndef __dsPIC30F__ /* needs a hook of port/posix */
static bool begin_and_count(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    if (data->value < 5) {
        CHECK(start_thread(two_ms, NULL) != 0);
    } else {
        _exit(lists_are_well_formed() && deliveries == 5 ? 0 : 1);
    }
    deliveries++;
    return true;
}

static uint16 woken_by_isr;
static void send_from_isr(void)
{
    CHECK(Sys_Send_IntEvent(E1, woken_by_isr++));
}

static void send_when_idle(uint32_t times)
{
    if (times % 7 == 0) {
        host_device(send_from_isr);
    }
}

TEST(a_kernel_without_threads_starts_threads_from_a_handler, "openswarm.h: Sys_Run_SystemThread, the kernel idles")
{
    boot();
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, begin_and_count, NULL));
    host_at_idle(send_when_idle);
    Sys_Run_SystemThread();
}
#endif

/* ---- Calls of an interrupt, and numbers at their limits -------------------------------------------------------------- */

static void call_options_in_isr(void)
{
    static const sys_process_config config = {.entry = two_ms};
    CHECK(!Sys_Lock_Mutex(&mutex) && !Sys_Lock_MutexTimeout(&mutex, 1) && !Sys_Unlock_Mutex(&mutex));
    CHECK(!Sys_Wait_for_Semaphore(&semaphore) && !Sys_Wait_for_SemaphoreTimeout(&semaphore, 1));
    CHECK(Sys_Wait_for_Notification(&notification, 1, 1) == 0);
    CHECK(Sys_Start_Joinable(&config) == 0 && !Sys_Join(victim) && !Sys_JoinTimeout(victim, 1));
    CHECK(!Sys_Push_Cleanup(&cleanup, note_letter, "x") && !Sys_Pop_Cleanup(true));
    CHECK(!Sys_Limit_Event(&quota, E1, 1) && !Sys_Keep_Latest(&quota, E1));
    CHECK(!Sys_Start_Timer(&timer, E1, 1, 1, 1) && !Sys_Stop_Timer(&timer));
    CHECK(!Sys_Start_Service(&services[0]) && !Sys_Feed_Watchdog());
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_CONTEXT);
}

TEST(an_isr_is_refused_by_every_option, "contract lines of openswarm_*.h: callers")
{
    enum { REFUSED = 17 };
    boot();
    CHECK(Sys_Register_Event(E1));
    victim = start_thread(sleep_for_ever, NULL);
    Sys_Sleep(1);
    semaphore.count = 1;
    notification.bits = 1;
    uint16 before = heap_now();
    host_device(call_options_in_isr);
    CHECK_EQ(Sys_Get_Statistics()->refused, REFUSED);
    CHECK_EQ(Sys_Get_LastError(), SYS_OK);
    CHECK_EQ(heap_now(), before);
    CHECK(semaphore.count == 1 && notification.bits == 1 && mutex.owner == NULL);
    Sys_Sleep(5);
    CHECK_EQ(heap_now(), before);
}

static uint16 last_size;
static bool measure_payload(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    const uint8 *bytes = data->payload;
    last_size = data->size;
    for (uint16 i = 0; i < data->size; i++) {
        CHECK_EQ(bytes[i], (uint8)(i * 7));
    }
    CHECK_EQ(data->value, data->size == 0 ? 0 : data->size == 1 ? 0 : 7 << 8);
    deliveries++;
    return true;
}

TEST(payloads_and_counters_at_their_limits, "openswarm.h: SYS_MAXIMUM_PAYLOAD; openswarm_semaphore.h, _quota.h: BUSY, dropped")
{
    static uint8 bytes[SYS_MAXIMUM_PAYLOAD + 1u];
    static const uint16 sizes[] = {0, 1, 2, 3, 15, SYS_LATEST_PAYLOAD};
    boot();
    for (unsigned i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8)(i * 7);
    }
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, measure_payload, NULL));
    uint16 before = heap_now();
    CHECK(!Sys_Send_Event(E1, bytes, SYS_MAXIMUM_PAYLOAD + 1u) && !Sys_Send_Event(E1, NULL, 1));
    CHECK(Sys_Send_Event(E1, NULL, 0));
    Sys_Yield();
    for (unsigned i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        CHECK(Sys_Send_Event(E1, bytes, sizes[i]));
        Sys_Yield();
        CHECK_EQ(last_size, sizes[i]);
    }
    CHECK_EQ(deliveries, 7);
    CHECK(Sys_Keep_Latest(&quota, E1));
    CHECK(Sys_Send_Event(E1, bytes, 3) && Sys_Send_Event(E1, bytes, 2) && Sys_Send_Event(E1, bytes, SYS_LATEST_PAYLOAD + 1));
    CHECK(Sys_Send_Event(E1, bytes, 3));
    Sys_Yield();
    CHECK(quota.dropped == 2 && last_size == 3 && deliveries == 8);
    CHECK(Sys_Unregister_Event(E1));
    CHECK(heap_now() <= before);
    semaphore.count = 0xFFFF;
    CHECK(!Sys_Signal_Semaphore(&semaphore));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_BUSY);
    CHECK_EQ(semaphore.count, 0xFFFF);
}

/* ---- Schedulers ------------------------------------------------------------------------------------------------------ */

static int choices;
static sys_pcb *exchange(sys_pcb *first)
{
    choices++;
    CHECK(Sys_Set_Scheduler(choices % 3 == 0 ? &sys_earliest_deadline : &sys_fixed_priority));
    (void)Sys_Send_IntEvent(E1, 1);
    return Sys_Next_Ready(first);
}

static const sys_scheduler exchanging = {exchange, true};
static bool exchange_in_handler(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    deliveries++;
    return Sys_Set_Scheduler(deliveries % 2 ? &exchanging : &sys_round_robin);
}

static void set_exchanging(void)
{
    CHECK(Sys_Set_Scheduler(&exchanging));
}

static void count_turns(void *turns)
{
    for (;;) {
        ++*(uint16 *)turns;
        Sys_Yield();
    }
}

TEST(schedulers_that_exchange_themselves, "openswarm_scheduler.h: sys_pick; Sys_Set_Scheduler in handlers and interrupts")
{
    static uint16 turns[3];
    boot();
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, exchange_in_handler, NULL));
    for (int i = 0; i < 3; i++) {
        CHECK(start_thread(count_turns, &turns[i]) != 0);
    }
    for (int i = 0; i < 300; i++) {
        host_device(set_exchanging);
        host_tick();
        CHECK(lists_are_well_formed());
        Sys_Yield();
        host_slice();
    }
    CHECK(choices > 100 && deliveries > 100);
    CHECK(turns[0] > 0 && turns[1] > 0 && turns[2] > 0);
}
