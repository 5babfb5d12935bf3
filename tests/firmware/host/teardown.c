/* SPDX-License-Identifier: MIT */
/* Teardown of a thread: leave every list, run the cleanups, free the memory (openswarm_cleanup.h). */
#include "test.h"

#include "openswarm_cleanup.h"
#include "openswarm_mutex.h"

static sys_mutex mutex = SYS_MUTEX(0);
static sys_cleanup of_thread[4];
static uint16 pids[4];

static void kill(void *pid)
{
    note(Sys_Kill_Process(*(const uint16 *)pid) ? 'k' : 'f');
}

static void look_at_mutex(void *unused)
{
    (void)unused;
    note(mutex.owner == NULL ? 'n' : 'o');
}

static void mutex_first(void *unused)
{
    CHECK(Sys_Lock_Mutex(&mutex) && Sys_Push_Cleanup(&of_thread[0], look_at_mutex, NULL));
    sleep_for_ever(unused);
}

static void cleanup_first(void *unused)
{
    CHECK(Sys_Push_Cleanup(&of_thread[0], look_at_mutex, NULL) && Sys_Lock_Mutex(&mutex));
    sleep_for_ever(unused);
}

static void end_in_order(void (*entry)(void *))
{
    boot();
    uint16 victim = start_thread(entry, NULL);
    Sys_Sleep(5);
    CHECK(Sys_Kill_Process(victim));
    CHECK(strcmp(trace, "n") == 0);
}

TEST(mutexes_are_released_before_cleanups_if_the_mutex_was_used_first, "openswarm_cleanup.h: a fixed order")
{
    end_in_order(mutex_first);
}

TEST(mutexes_are_released_before_cleanups_if_the_cleanup_was_used_first, "openswarm_cleanup.h: a fixed order")
{
    end_in_order(cleanup_first);
}

static void push_kill(void *other)
{
    uint16 number = (uint16)((const uint16 *)other - pids);
    CHECK(Sys_Push_Cleanup(&of_thread[number], kill, other));
    sleep_for_ever(NULL);
}

TEST(threads_whose_cleanups_kill_each_other_end_once, "openswarm_cleanup.h: ends other threads")
{
    boot();
    uint16 empty = heap_now();
    Sys_Subscribe_to_Event(SYS_EVENT_TERMINATION, 0, count_delivery, NULL);
    uint16 one_more = heap_now();
    pids[0] = start_thread(push_kill, &pids[1]);
    pids[1] = start_thread(push_kill, &pids[2]);
    pids[2] = start_thread(push_kill, &pids[0]);
    Sys_Sleep(40);
    CHECK(Sys_Kill_Process(pids[1]));
    CHECK(strcmp(trace, "kkf") == 0); /* the last cleanup finds pids[1] ended */
    Sys_Sleep(2);
    CHECK_EQ(deliveries, 3);
    CHECK(lists_are_well_formed());
    CHECK_EQ(heap_now(), one_more);
    Sys_Unsubscribe_from_Event(SYS_EVENT_TERMINATION, 0);
    CHECK_EQ(heap_now(), empty);
}

static void kill_killer(void *unused)
{
    CHECK(Sys_Push_Cleanup(&of_thread[0], note_letter, "l") && Sys_Push_Cleanup(&of_thread[1], kill, &pids[3]));
    sleep_for_ever(unused);
}

static bool kill_in_handler(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    CHECK(Sys_Kill_Process(pids[0]));
    return true;
}

TEST(a_cleanup_in_a_handler_may_kill_the_interrupted_thread, "openswarm_cleanup.h: ends other threads")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, kill_in_handler, NULL);
    uint16 empty = heap_now();
    pids[0] = start_thread(kill_killer, NULL);
    Sys_Sleep(5);
    pids[3] = start_thread(sleep_for_ever, NULL);
    Sys_Send_IntEvent(E1, 0);
    Sys_Sleep(20);
    CHECK(strcmp(trace, "kl") == 0);
    CHECK_EQ(Sys_Get_ProcessID(), 0);
    CHECK(lists_are_well_formed());
    CHECK_EQ(heap_now(), empty);
}

TEST(a_cleanup_without_a_function_is_refused, "openswarm_cleanup.h: ARGUMENT")
{
    boot();
    CHECK(!Sys_Push_Cleanup(&of_thread[0], NULL, NULL));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    CHECK(!Sys_Push_Cleanup(NULL, note_letter, NULL));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
}

static void return_at_once(void)
{
}

static void sleep_5_ms(void)
{
    Sys_Sleep(5);
}

TEST(a_lost_report_of_an_end_leaves_the_waiting_main_alone, "openswarm.h: Sys_Sleep, Sys_Get_LastError; the error once replaced main's time-out")
{
    boot();
    CHECK(Sys_Unregister_Event(SYS_EVENT_TERMINATION));
    CHECK(Sys_Start_Process(return_at_once) != 0 && Sys_Start_Process(sleep_5_ms) != 0);
    uint32 before = Sys_Get_SystemTime();
    Sys_Sleep(9);
    CHECK_EQ(Sys_Get_SystemTime() - before, 9);
    CHECK_EQ(Sys_Get_LastError(), SYS_OK);
}
