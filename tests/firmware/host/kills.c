/* SPDX-License-Identifier: MIT */
/* Kills within calls, handlers and cleanups, and of threads that were just given a mutex, a unit or a bit. Afterwards no
 * memory is lost and the kernel continues. */
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
static sys_cleanup cleanup, other_cleanup;
static uint16 victim, helper;

static void two_ms(void *unused)
{
    (void)unused;
    Sys_Sleep(2);
}

static bool kill_victim(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    (void)Sys_Kill_Process(victim);
    return true;
}

/* ---- At every unlock of a thread's calls, and at every allocation --------------------------------------------------- */

#ifndef __dsPIC30F__ /* needs the hooks of port/posix */

static void scene_waits(void)
{
    sys_event_data *data = Sys_Wait_for_ConditionTimeout(E1, NULL, 2);
    Sys_Clear_EventData(&data);
    (void)Sys_Wait_for_SemaphoreTimeout(&semaphore, 2);
    (void)Sys_Wait_for_Notification(&notification, 1, 2);
}

static void scene_owns(void)
{
    CHECK(Sys_Lock_Mutex(&mutex) && Sys_Push_Cleanup(&cleanup, note_letter, "c"));
    Sys_Yield();
    CHECK(Sys_Unlock_Mutex(&mutex) && Sys_Pop_Cleanup(false));
    (void)Sys_Lock_MutexTimeout(&mutex, 3);
}

static void scene_joins(void)
{
    static const sys_process_config config = {.entry = two_ms};
    uint16 pid = Sys_Start_Joinable(&config);
    if (pid != 0) {
        (void)Sys_JoinTimeout(pid, 1);
        (void)Sys_Join(pid);
    }
}

static void scene_builds(void)
{
    (void)Sys_Register_Event(E2);
    (void)Sys_Limit_Event(&quota, E2, 1);
    (void)Sys_Subscribe_to_Event(E2, Sys_Get_ProcessID(), count_delivery, NULL);
    (void)Sys_Start_Timer(&timer, E2, 1, 1, 1);
    (void)Sys_Send_IntEvent(E2, 1);
    Sys_Sleep(3);
    (void)Sys_Stop_Timer(&timer);
    (void)Sys_Unsubscribe_from_Event(E2, Sys_Get_ProcessID());
    (void)Sys_Unregister_Event(E2);
}

static void (*const scenes[])(void) = {scene_waits, scene_owns, scene_joins, scene_builds};
enum { SCENES = sizeof scenes / sizeof *scenes };

static void run_scene(void *number)
{
    scenes[*(const int *)number]();
}

static bool struck;
static void send_kill(void)
{
    (void)Sys_Send_IntEvent(E3, 0);
}

static void strike(void)
{
    struck = true;
    host_device(send_kill);
    host_slice();
}

/* The block of a quota stays for the event's next one: every round begins with it. */
static void leave_a_quota(void)
{
    CHECK(Sys_Register_Event(E2) && Sys_Limit_Event(&quota, E2, 1) && Sys_Unregister_Event(E2));
}

static void put_back(void)
{
    for (uint16 pid = victim; pid <= victim + 1u; pid++) { /* the second kill removes a zombie */
        (void)Sys_Kill_Process(pid);
        (void)Sys_Kill_Process(pid);
    }
    (void)Sys_Stop_Timer(&timer);
    leave_a_quota();
    semaphore.count = 0;
    notification.bits = 0;
    Sys_Sleep(2);
}

static uint16 boot_with_killer(void)
{
    boot();
    CHECK(Sys_Register_Event(E1) && Sys_Register_Event(E3));
    CHECK(Sys_Subscribe_to_Event(E3, 0, kill_victim, NULL));
    leave_a_quota();
    return heap_now();
}

static void kill_at_every_unlock(const sys_scheduler *scheduler)
{
    uint16 empty = boot_with_killer();
    CHECK(Sys_Set_Scheduler(scheduler));
    for (int scene = 0; scene < SCENES; scene++) {
        for (unsigned long n = 1;; n++) {
            struck = false;
            victim = start_thread(run_scene, &scene);
            CHECK(victim != 0);
            host_at_unlock(n, strike);
            Sys_Sleep(12);
            host_at_unlock(0, NULL);
            put_back();
            CHECK(lists_are_well_formed());
            CHECK(mutex.owner == NULL && mutex.waiters == NULL);
            CHECK_EQ(heap_now(), empty);
            CHECK(n < 2000 && (struck || n > 20));
            if (!struck) {
                break;
            }
        }
    }
}

TEST(a_kill_at_every_unlock_of_any_call_loses_nothing, "openswarm_cleanup.h: teardown; calls of openswarm.h and its options")
{
    kill_at_every_unlock(&sys_round_robin);
}

TEST(an_eager_kill_at_every_unlock_of_any_call_loses_nothing, "the same; openswarm_scheduler.h: eager")
{
    kill_at_every_unlock(&sys_fixed_priority);
}

TEST(a_failing_allocation_in_any_call_loses_nothing, "openswarm.h: MEMORY")
{
    uint16 empty = boot_with_killer();
    for (int scene = 0; scene < SCENES; scene++) {
        for (unsigned long n = 1; n < 12; n++) {
            victim = start_thread(run_scene, &scene);
            CHECK(victim != 0);
            host_fail_allocation(n);
            Sys_Sleep(12);
            host_fail_allocation(0);
            put_back();
            CHECK(lists_are_well_formed());
            CHECK_EQ(heap_now(), empty);
        }
    }
}
#endif

/* ---- Cleanups ----------------------------------------------------------------------------------------------------- */

static void unregister_delivered(void *unused)
{
    (void)unused;
    uint16 pid = Sys_Get_ProcessID();
    note(Sys_Subscribe_to_Event(E2, pid, count_delivery, NULL) ? 's' : 'r'); /* a PID that no call finds */
    note(Sys_Get_LastError() == SYS_ERROR_PROCESS ? 'p' : '?');
    note(Sys_Push_Cleanup(&other_cleanup, note_letter, "x") ? '?' : 'u');
    note(Sys_Pop_Cleanup(true) ? '?' : 'o');
    note(Sys_Kill_Process(pid) ? '?' : 'k');
    for (int i = 0; i < 3; i++) {
        Sys_End_CriticalSection();
    }
    CHECK(Sys_Unregister_Event(E3) && Sys_Register_Event(E3));
    CHECK(start_thread(two_ms, NULL) != 0);
}

static void push_and_wait(void *unused)
{
    CHECK(Sys_Push_Cleanup(&cleanup, unregister_delivered, NULL));
    CHECK(Sys_Subscribe_to_Event(E3, Sys_Get_ProcessID(), count_delivery, NULL));
    (void)Sys_Wait_for_Event(E3);
    sleep_for_ever(unused);
}

TEST(a_cleanup_unregisters_the_event_whose_handler_killed, "openswarm_cleanup.h: a cleanup may call what a handler may call")
{
    boot();
    Sys_Register_Event(E2);
    Sys_Register_Event(E3);
    uint16 empty = heap_now();
    CHECK(Sys_Subscribe_to_Event(E3, 0, kill_victim, NULL));
    victim = start_thread(push_and_wait, NULL);
    Sys_Sleep(2);
    CHECK(Sys_Send_IntEvent(E3, 1));
    Sys_Sleep(6);
    CHECK(strcmp(trace, "rpuok") == 0);
    CHECK_EQ(deliveries, 0);
    CHECK(lists_are_well_formed());
    CHECK_EQ(heap_now(), empty);
}

static void kill_other(void *pid)
{
    note(Sys_Kill_Process(*(const uint16 *)pid) ? 'k' : 'f');
}

static void wait_for_mutex(void *pushes)
{
    if (pushes != NULL) {
        CHECK(Sys_Push_Cleanup(&other_cleanup, note_letter, "w"));
    }
    (void)Sys_Lock_Mutex(&mutex);
    note('m');
    sleep_for_ever(NULL);
}

static void own_and_kill(void *pid)
{
    CHECK(Sys_Push_Cleanup(&cleanup, kill_other, pid) && Sys_Lock_Mutex(&mutex));
    sleep_for_ever(NULL);
}

TEST(a_cleanup_kills_the_waiter_that_just_got_the_mutex, "openswarm_cleanup.h: mutexes are handed on first")
{
    static uint16 waiter, next;
    boot();
    uint16 empty = heap_now();
    victim = start_thread(own_and_kill, &waiter);
    Sys_Sleep(1);
    waiter = start_thread(wait_for_mutex, "");
    Sys_Sleep(1);
    next = start_thread(wait_for_mutex, NULL);
    Sys_Sleep(1);
    CHECK(Sys_Kill_Process(victim));
    Sys_Sleep(2);
    CHECK(strcmp(trace, "kwm") == 0);
    CHECK(mutex.owner != NULL);
    CHECK(Sys_Kill_Process(next));
    CHECK(mutex.owner == NULL);
    CHECK_EQ(heap_now(), empty);
}

static void end_with_section(void *unused)
{
    (void)unused;
    CHECK(Sys_Push_Cleanup(&cleanup, note_letter, "c"));
    Sys_Start_CriticalSection();
    Sys_Start_CriticalSection();
}

TEST(sections_end_with_their_thread, "openswarm.h: Sys_Start_CriticalSection; cleanups run as in a section")
{
    boot();
    uint16 empty = heap_now();
    CHECK(start_thread(end_with_section, NULL) != 0);
    Sys_Sleep(3); /* refused if the section had stayed open */
    CHECK_EQ(Sys_Get_SystemTime(), 3);
    Sys_Start_CriticalSection();
    victim = start_thread(own_and_kill, &helper);
    Sys_End_CriticalSection();
    Sys_Sleep(1);
    Sys_Start_CriticalSection();
    CHECK(Sys_Kill_Process(victim));
    Sys_Sleep(1);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_CONTEXT); /* the cleanup ended no section of its killer */
    Sys_End_CriticalSection();
    CHECK(strcmp(trace, "cf") == 0);
    Sys_Sleep(1);
    CHECK_EQ(heap_now(), empty);
}

/* ---- Units, bits and time-outs whose receiver dies ------------------------------------------------------------------ */

static void take_unit(void *letter)
{
    if (Sys_Wait_for_Semaphore(&semaphore)) {
        note(*(const char *)letter);
    }
    sleep_for_ever(NULL);
}

static void take_bit(void *letter)
{
    if (Sys_Wait_for_Notification(&notification, 3, 0) != 0) {
        note(*(const char *)letter);
    }
    sleep_for_ever(NULL);
}

static bool signal_then_kill(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    CHECK(Sys_Signal_Semaphore(&semaphore));
    Sys_Notify(&notification, 1);
    CHECK(Sys_Kill_Process(victim) && Sys_Kill_Process(helper));
    return true;
}

TEST(what_was_given_to_a_thread_that_dies_is_left_for_the_next, "openswarm_semaphore.h, openswarm_notification.h")
{
    boot();
    Sys_Register_Event(E1);
    CHECK(Sys_Subscribe_to_Event(E1, 0, signal_then_kill, NULL));
    uint16 empty = heap_now();
    victim = start_thread(take_unit, "a");
    helper = start_thread(take_bit, "b");
    Sys_Sleep(1);
    uint16 second = start_thread(take_unit, "c");
    CHECK(Sys_Send_IntEvent(E1, 1));
    Sys_Sleep(2);
    uint16 last = start_thread(take_bit, "d");
    Sys_Sleep(2);
    CHECK(strcmp(trace, "cd") == 0);
    CHECK(semaphore.count == 0 && notification.bits == 0);
    CHECK(Sys_Kill_Process(second) && Sys_Kill_Process(last));
    Sys_Sleep(1);
    CHECK_EQ(heap_now(), empty);
}

/* ---- Chains and ends ------------------------------------------------------------------------------------------------ */

enum { CHAIN = 9 };
static uint16 chain[CHAIN];
static sys_cleanup chain_cleanups[2 * CHAIN];

static void link_chain(void *own)
{
    uint16 place = (uint16)((const uint16 *)own - chain);
    CHECK(Sys_Push_Cleanup(&chain_cleanups[2 * place], kill_other, &chain[(place + 1) % CHAIN]));
    CHECK(Sys_Push_Cleanup(&chain_cleanups[2 * place + 1], kill_other, &chain[(place + 2) % CHAIN]));
    sleep_for_ever(NULL);
}

TEST(a_chain_of_cleanups_that_kill_ends_each_thread_once, "openswarm_cleanup.h: their cleanups follow those of this thread")
{
    boot();
    CHECK(Sys_Subscribe_to_Event(SYS_EVENT_TERMINATION, 0, count_delivery, NULL));
    uint16 empty = heap_now();
    for (int i = 0; i < CHAIN; i++) {
        chain[i] = start_thread(link_chain, &chain[i]);
        CHECK(chain[i] != 0);
    }
    Sys_Sleep(2);
    CHECK(Sys_Kill_Process(chain[4]));
    Sys_Sleep(2);
    CHECK_EQ(deliveries, CHAIN);
    CHECK_EQ(strlen(trace), 2 * CHAIN);
    CHECK(lists_are_well_formed());
    CHECK_EQ(heap_now(), empty);
}

static sys_service service;
static int starts;
static void start_again(void *unused)
{
    (void)unused;
    note(Sys_Start_Service(&service) ? 's' : 'r');
    CHECK(!Sys_Unlock_Mutex(&mutex)); /* given back before the cleanup */
}

static void end_at_once(void *unused)
{
    (void)unused;
    CHECK(Sys_Lock_Mutex(&mutex));
    if (starts++ < 4) {
        CHECK(Sys_Push_Cleanup(&cleanup, start_again, NULL));
    }
}

TEST(a_service_without_restarts_is_started_again_by_its_cleanup, "openswarm_service.h: may be started again")
{
    static const sys_process_config config = {.entry = end_at_once};
    boot();
    uint16 empty = heap_now();
    service = (sys_service){.config = &config};
    CHECK(Sys_Start_Service(&service));
    Sys_Sleep(30);
    CHECK_EQ(starts, 5);
    CHECK(strcmp(trace, "ssss") == 0);
    CHECK(service.pid == 0 && mutex.owner == NULL);
    CHECK_EQ(heap_now(), empty);
}

