/* The options with which threads wait without losing a wake-up, and time-outs: semaphores, notifications, timers, join
 * with time-out. Part of the image of options.c. */
#include "conformance.h"

#include <openswarm_join.h>
#include <openswarm_notification.h>
#include <openswarm_semaphore.h>
#include <openswarm_timer.h>

#define FILE_LETTER 'w'

enum { BIT_A = 1, BIT_B = 0x8000, ITEMS = 40, PATIENCE = 3000 };

static sys_semaphore units = SYS_SEMAPHORE(0);
static sys_notification notice;
static const char letters[] = "ab";

static void wait_until_noted(const char *text)
{
    for (uint16 i = 0; i < PATIENCE && !noted(text); i++) {
        Sys_Sleep(1);
    }
}

/* ---- Semaphores -------------------------------------------------------------------------------------------------- */

static void take_one(void *letter)
{
    note(Sys_Wait_for_Semaphore(&units) ? *(const char *)letter : '?');
}

static void signals_are_counted(void)
{
    CHECK(Sys_Signal_Semaphore(&units) && Sys_Signal_Semaphore(&units) && units.count == 2);
    CHECK(Sys_Wait_for_Semaphore(&units) && Sys_Wait_for_SemaphoreTimeout(&units, 1) && units.count == 0);
    CHECK(refused_as(Sys_Wait_for_SemaphoreTimeout(&units, 3), SYS_OK));
    units.count = 0xFFFF;
    CHECK(refused_as(Sys_Signal_Semaphore(&units), SYS_ERROR_BUSY) && units.count == 0xFFFF);
    units.count = 0;
    Sys_Start_CriticalSection();
    CHECK(Sys_Signal_Semaphore(&units) && refused_as(Sys_Wait_for_Semaphore(&units), SYS_ERROR_CONTEXT));
    Sys_End_CriticalSection();
    CHECK(Sys_Wait_for_Semaphore(&units) && units.count == 0);
}

static void units_go_in_order_of_waiting(void)
{
    uint16 heap = heap_now();
    forget();
    uint16 a = start(take_one, (void *)&letters[0], 0);
    Sys_Sleep(12);
    uint16 b = start(take_one, (void *)&letters[1], 0);
    Sys_Sleep(12);
    CHECK(a != 0 && b != 0 && Sys_Get_ProcessState(a) == SYS_BLOCKED);
    Sys_Start_CriticalSection();
    CHECK(Sys_Signal_Semaphore(&units));
    Sys_End_CriticalSection();
    CHECK(!Sys_Wait_for_SemaphoreTimeout(&units, 12)); /* a's unit cannot be overtaken */
    wait_until_noted("a");
    CHECK(noted("a") && Sys_Kill_Process(b) && Sys_Signal_Semaphore(&units));
    Sys_Sleep(12);
    CHECK(noted("a") && units.count == 1 && Sys_Wait_for_Semaphore(&units) && heap_now() == heap);
}

static uint16 sent;

static bool send_unit(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    sent++;
    (void)Sys_Signal_Semaphore(&units);
    return sent < ITEMS;
}

static void no_signal_is_lost(void)
{
    uint16 got = 0;
    sent = 0;
    CHECK(Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, send_unit, NULL));
    while (got < ITEMS && Sys_Wait_for_SemaphoreTimeout(&units, PATIENCE)) {
        got++;
    }
    CHECK(got == ITEMS && sent == ITEMS && units.count == 0);
}

/* ---- Notifications ----------------------------------------------------------------------------------------------- */

static void await_bits(void *unused)
{
    (void)unused;
    note(Sys_Wait_for_Notification(&notice, BIT_A, 0) == BIT_A ? 'n' : '?');
}

static void notifications_are_latched(void)
{
    Sys_Notify(&notice, BIT_A);
    Sys_Notify_Value(&notice, BIT_A | BIT_B, 7);
    CHECK(Sys_Wait_for_Notification(&notice, BIT_B, 0) == BIT_B && notice.value == 7 && notice.bits == BIT_A);
    CHECK(Sys_Wait_for_Notification(&notice, 0xFFFF, 1) == BIT_A);
    CHECK(refused_as(Sys_Wait_for_Notification(&notice, 0xFFFF, 3) != 0, SYS_OK));
    CHECK(refused_as(Sys_Wait_for_Notification(&notice, 0, 3) != 0, SYS_ERROR_ARGUMENT));
    Sys_Start_CriticalSection();
    Sys_Notify(&notice, BIT_A);
    CHECK(refused_as(Sys_Wait_for_Notification(&notice, BIT_A, 0) != 0, SYS_ERROR_CONTEXT));
    Sys_End_CriticalSection();
    CHECK(Sys_Wait_for_Notification(&notice, BIT_A, 0) == BIT_A);
}

static void only_its_bits_wake_a_thread(void)
{
    uint16 heap = heap_now();
    forget();
    uint16 pid = start(await_bits, NULL, 0);
    Sys_Sleep(12);
    CHECK(refused_as(Sys_Wait_for_Notification(&notice, BIT_B, 1) != 0, SYS_ERROR_BUSY));
    Sys_Notify(&notice, BIT_B);
    Sys_Sleep(12);
    CHECK(Sys_Get_ProcessState(pid) == SYS_BLOCKED && notice.bits == BIT_B);
    Sys_Notify(&notice, BIT_A);
    wait_until_noted("n");
    CHECK(noted("n") && notice.bits == BIT_B && Sys_Wait_for_Notification(&notice, BIT_B, 1) == BIT_B);
    pid = start(await_bits, NULL, 0);
    Sys_Sleep(12);
    Sys_Start_CriticalSection();
    Sys_Notify(&notice, BIT_A);
    CHECK(Sys_Kill_Process(pid)); /* the thread has not taken the bit */
    Sys_End_CriticalSection();
    CHECK(Sys_Wait_for_Notification(&notice, BIT_A, 1) == BIT_A && heap_now() == heap);
}

static volatile bool full;

static bool produce(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    if (!full) {
        full = true;
        sent++;
        Sys_Notify(&notice, BIT_A);
    }
    return sent < ITEMS;
}

/* An item that is produced between the check and the wait wakes the consumer. */
static void no_wakeup_is_lost(void)
{
    uint16 got = 0, timeouts = 0;
    sent = 0;
    CHECK(Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, produce, NULL));
    while (got < ITEMS && timeouts == 0) {
        if (full) {
            full = false;
            got++;
            for (volatile uint16 i = 0; i < got * 61u; i++) {
            }
        } else {
            timeouts = (uint16)(timeouts + (Sys_Wait_for_Notification(&notice, BIT_A, PATIENCE) == 0));
        }
    }
    CHECK(got == ITEMS && timeouts == 0);
    (void)Sys_Wait_for_Notification(&notice, BIT_A, 1);
}

/* ---- Timers ------------------------------------------------------------------------------------------------------ */

static uint16 heard, sum;

static bool hear(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    heard++;
    sum = (uint16)(sum + data->value);
    return true;
}

static void hear_until(uint16 count)
{
    for (uint16 i = 0; i < PATIENCE && heard < count; i++) {
        Sys_Sleep(1);
    }
}

static void timers_send_their_events(void)
{
    static sys_timer once, often;
    uint16 heap = heap_now();
    heard = sum = 0;
    CHECK(refused_as(Sys_Start_Timer(&once, E1, 1, 0, 5), SYS_ERROR_ARGUMENT));
    CHECK(refused_as(Sys_Stop_Timer(&once), SYS_ERROR_PROCESS));
    CHECK(Sys_Start_Timer(&once, E1, 1, 1, 1) && Sys_Stop_Timer(&once)); /* before its event is registered */
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, hear, NULL));
    uint32 begin = Sys_Get_SystemTime();
    CHECK(Sys_Start_Timer(&once, E1, 100, 4, 0) && Sys_Start_Timer(&often, E1, 1, 6, 5));
    hear_until(1);
    CHECK(heard == 1 && sum == 100 && Sys_Get_SystemTime() - begin >= 4);
    hear_until(5);
    CHECK(heard >= 5 && sum == 99u + heard && Sys_Get_SystemTime() - begin >= 6 + 3 * 5);
    CHECK(refused_as(Sys_Stop_Timer(&once), SYS_ERROR_PROCESS) && Sys_Stop_Timer(&often));
    Sys_Sleep(2);
    heard = 0;
    Sys_Sleep(15);
    CHECK(heard == 0);
    CHECK(Sys_Start_Timer(&once, E1, 1, 30000, 0) && Sys_Start_Timer(&once, E1, 2, 2, 0)); /* the second restarts it */
    hear_until(1);
    Sys_Sleep(5);
    CHECK(heard == 1 && refused_as(Sys_Stop_Timer(&once), SYS_ERROR_PROCESS));
    CHECK(Sys_Unregister_Event(E1) && heap_now() == heap);
}

/* ---- Join with time-out ------------------------------------------------------------------------------------------ */

static void sleep_briefly(void *ms)
{
    Sys_Sleep(*(const uint16 *)ms);
}

static void joins_end_in_time(void)
{
    static const uint16 lasting = 40;
    uint16 heap = heap_now();
    uint16 pid = start(sleep_briefly, (void *)&lasting, 0);
    CHECK(refused_as(Sys_JoinTimeout(pid, 2), SYS_OK) && Sys_Get_ProcessState(pid) == SYS_BLOCKED);
    CHECK(refused_as(Sys_JoinTimeout(pid, 1), SYS_OK) && Sys_JoinTimeout(pid, PATIENCE));
    CHECK(Sys_Get_ProcessState(pid) == SYS_UNKNOWN && refused_as(Sys_JoinTimeout(pid, 1), SYS_ERROR_PROCESS));
    Sys_Yield();
    CHECK(heap_now() == heap);
}

void check_waits(void)
{
    static const sys_scheduler *const all[] = {&sys_round_robin, &sys_woken_first, &sys_fixed_priority};
    for (uint8 i = 0; i < 3; i++) {
        Sys_Set_Scheduler(all[i]);
        signals_are_counted();
        units_go_in_order_of_waiting();
        no_signal_is_lost();
        notifications_are_latched();
        only_its_bits_wake_a_thread();
        no_wakeup_is_lost();
        timers_send_their_events();
        joins_end_in_time();
    }
    Sys_Set_Scheduler(&sys_round_robin);
}
