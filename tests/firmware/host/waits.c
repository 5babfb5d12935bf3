/* Waits that lose no wake-up: an interrupt posts at every unlock around the check and the wait. Semaphores and
 * notifications of the interrupt; timers and joins at the limits of the 16-bit clock. */
#include "test.h"

#include "openswarm_join.h"
#include "openswarm_notification.h"
#include "openswarm_semaphore.h"
#include "openswarm_timer.h"

enum { POINTS = 120, BIT = 4, LONG = 65535, LONGEST_TIMER = 32767 };

static sys_semaphore units = SYS_SEMAPHORE(0);
static sys_notification notice;

static void post(void)
{
    CHECK(Sys_Signal_Semaphore(&units));
    Sys_Notify(&notice, BIT);
}

static void post_from_interrupt(void)
{
    host_device(post);
}

TEST(a_post_at_any_point_ends_the_wait, "openswarm_semaphore.h, openswarm_notification.h: no wake-up is lost")
{
    static const sys_scheduler *const all[] = {&sys_round_robin, &sys_fixed_priority};
    boot();
    for (int i = 0; i < 2; i++) {
        CHECK(Sys_Set_Scheduler(all[i]));
        for (unsigned long n = 1; n <= POINTS; n++) {
            host_at_unlock(n, post_from_interrupt);
            CHECK(Sys_Wait_for_SemaphoreTimeout(&units, LONG));
            CHECK_EQ(Sys_Wait_for_Notification(&notice, BIT, LONG), BIT);
            host_at_unlock(n, post_from_interrupt);
            CHECK_EQ(Sys_Wait_for_Notification(&notice, BIT | 1, LONG), BIT);
            CHECK(Sys_Wait_for_SemaphoreTimeout(&units, LONG));
            CHECK(units.count == 0 && notice.bits == 0);
        }
    }
}

static void consume(void)
{
    for (;;) {
        (void)Sys_Wait_for_Semaphore(&units);
        (void)Sys_Wait_for_Notification(&notice, BIT, 0);
    }
}

static uint16 victim;

static void kill_victim(void)
{
    CHECK(Sys_Kill_Process(victim));
}

TEST(a_waiting_thread_may_be_killed_at_any_point, "the lists stay whole, and no memory is lost")
{
    boot();
    uint16 empty = heap_now();
    for (unsigned long n = 1; n <= POINTS; n++) {
        units.count = 0;
        notice.bits = 0;
        victim = Sys_Start_Process(consume);
        uint16 other = Sys_Start_Process(consume);
        Sys_Sleep(20);
        host_at_unlock(n, post_from_interrupt);
        Sys_Sleep(n % 3 == 0 ? 0 : 1);
        kill_victim();
        CHECK(lists_are_well_formed());
        Sys_Sleep(20);
        host_at_unlock(0, NULL);
        CHECK(Sys_Kill_Process(other));
        Sys_Yield();
        CHECK_EQ(heap_now(), empty);
    }
}

static uint16 expired;

static bool count_expiry(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    expired++;
    return true;
}

TEST(timers_are_exact_to_a_tick_and_do_not_drift, "openswarm_timer.h")
{
    static sys_timer shortest, longest, periodic;
    boot();
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, count_expiry, NULL));
    CHECK(!Sys_Start_Timer(&longest, E1, 0, LONGEST_TIMER + 1u, 0) && !Sys_Start_Timer(&longest, E1, 0, 1, LONGEST_TIMER + 1u));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    for (int round = 0; round < 4; round++) { /* the low word of the system time wraps */
        expired = 0;
        CHECK(Sys_Start_Timer(&longest, E1, 0, LONGEST_TIMER, 0) && Sys_Start_Timer(&shortest, E1, 0, 1, 0));
        Sys_Sleep(2);
        CHECK_EQ(expired, 1);
        Sys_Sleep(LONGEST_TIMER - 4);
        CHECK_EQ(expired, 1);
        Sys_Sleep(3);
        CHECK_EQ(expired, 2);
    }
    expired = 0;
    uint32 begin = Sys_Get_SystemTime();
    CHECK(Sys_Start_Timer(&periodic, E1, 0, 7, 7));
    while (expired < 1000) {
        Sys_Sleep(1);
    }
    CHECK_EQ(Sys_Get_SystemTime() - begin, 7000);
    Sys_Start_CriticalSection();
    for (int i = 0; i < 71; i++) {
        host_tick();
    }
    Sys_End_CriticalSection();
    expired = 0;
    Sys_Yield();
    CHECK_EQ(expired, 1); /* the missed periods are skipped */
    Sys_Sleep(7);
    CHECK_EQ(expired, 2);
    CHECK(Sys_Stop_Timer(&periodic) && !Sys_Stop_Timer(&periodic));
}

static void sleep_five(void)
{
    Sys_Sleep(5);
}

TEST(a_join_whose_time_is_over_may_still_see_the_end, "openswarm_join.h: Sys_JoinTimeout")
{
    boot();
    uint16 empty = heap_now();
    for (uint16 ms = 1; ms < 12; ms++) {
        uint16 pid = Sys_Start_Process(sleep_five);
        bool ended = Sys_JoinTimeout(pid, ms);
        CHECK(ended || ms <= 6);
        CHECK(!ended || Sys_Get_ProcessState(pid) == SYS_UNKNOWN);
        CHECK(!ended || ms >= 5);
        Sys_Sleep(20);
        CHECK(lists_are_well_formed() && heap_now() == empty);
    }
}
