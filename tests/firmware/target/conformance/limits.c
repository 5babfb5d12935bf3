/* The options quota and service, also used by hostile programs; in the image of options.c. */
#include "conformance.h"

#include <openswarm_quota.h>
#include <openswarm_service.h>

#define FILE_LETTER 'l'

/* ---- Quota ------------------------------------------------------------------------------------------------------- */

static sys_quota quota, quota_too;
static uint16 heard, last;

static bool hear(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    heard++;
    last = data->value;
    return true;
}

static uint16 delivered(uint16 event, uint16 messages)
{
    heard = 0;
    Sys_Start_CriticalSection();
    for (uint16 i = 1; i <= messages; i++) {
        CHECK(Sys_Send_IntEvent(event, i));
    }
    Sys_End_CriticalSection();
    Sys_Yield();
    return heard;
}

static void quotas_bound_what_waits(void)
{
    CHECK(refused_as(Sys_Limit_Event(&quota, E1, 2), SYS_ERROR_EVENT));
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, hear, NULL));
    CHECK(refused_as(Sys_Limit_Event(&quota, E1, 0), SYS_ERROR_ARGUMENT) && delivered(E1, 5) == 5);
    CHECK(Sys_Limit_Event(&quota, E1, 2) && delivered(E1, 5) == 2 && last == 2 && quota.dropped == 3);
    CHECK(Sys_Keep_Latest(&quota_too, E1) && delivered(E1, 5) == 1 && last == 5 && quota_too.dropped == 0);
    Sys_Start_CriticalSection();
    CHECK(Sys_Send_IntEvent(E1, 7) && Sys_Send_Event(E1, "text", 4)); /* another payload size: dropped */
    Sys_End_CriticalSection();
    Sys_Yield();
    CHECK(last == 7 && quota_too.dropped == 1 && Sys_Unregister_Event(E1));
}

/* Sets a quota twice; its event is unregistered and registered again between two others of the same bucket. */
static void quotas_come_and_go(void)
{
    uint16 heap = heap_now();
    for (uint8 i = 0; i < 20; i++) {
        CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, hear, NULL));
        CHECK(Sys_Limit_Event(&quota, E1, 1) && Sys_Limit_Event(&quota, E1, 2) && delivered(E1, 4) == 2);
        CHECK(Sys_Unregister_Event(E1) && Sys_Register_Event(E1) && Sys_Register_Event(E1 + 8));
        CHECK(Sys_Subscribe_to_Event(E1, 0, hear, NULL) && delivered(E1, 4) == 4); /* the quota ended with its event */
        CHECK(Sys_Unregister_Event(E1) && Sys_Unregister_Event(E1 + 8));
    }
    CHECK(heap_now() <= heap + 4 * sizeof(void *)); /* memory that the event's next quota will use */
}

static bool leave(uint16 pid, uint16 event, sys_event_data *data)
{
    heard++;
    CHECK(Sys_Send_IntEvent(event, data->value) && Sys_Send_IntEvent(event, data->value));
    return Sys_Unsubscribe_Handler(event, pid, leave) && Sys_Unregister_Event(event);
}

static void a_handler_ends_its_limited_event(void)
{
    uint16 heap = heap_now();
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, leave, NULL) && Sys_Keep_Latest(&quota, E1));
    CHECK(delivered(E1, 3) == 1 && !Sys_IsEventRegistered(E1) && heap_now() <= heap + 4 * sizeof(void *));
}

static uint16 taken, most_waiting;

static void send_ten(void)
{
    for (uint8 i = 0; i < 10; i++) {
        uint16 dropped = quota.dropped;
        CHECK(Sys_Send_IntEvent(E1, i));
        taken = (uint16)(taken + (quota.dropped == dropped));
    }
    if ((uint16)(taken - heard) > most_waiting) {
        most_waiting = (uint16)(taken - heard);
    }
}

static bool send_in_delivery(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    send_ten();
    return true;
}

static void a_quota_counts_the_current_delivery(void)
{
    heard = taken = most_waiting = 0;
    CHECK(Sys_Register_Event(E1) && Sys_Register_Event(E2) && Sys_Limit_Event(&quota, E1, 4));
    CHECK(Sys_Subscribe_to_Event(E2, 0, send_in_delivery, NULL) && Sys_Subscribe_to_Event(E1, 0, hear, NULL));
    Sys_Start_CriticalSection();
    CHECK(Sys_Send_IntEvent(E2, 0));
    send_ten();
    Sys_End_CriticalSection();
    Sys_Sleep(20);
    CHECK(most_waiting == 4 && heard == taken && Sys_Unregister_Event(E1) && Sys_Unregister_Event(E2));
}

/* ---- Services ---------------------------------------------------------------------------------------------------- */

static volatile uint16 begins;
static void end_at_once(void *unused)
{
    (void)unused;
    begins++;
}

static void never_yield(void *unused)
{
    begins++;
    CHECK(Sys_Feed_Watchdog());
    spin_for_ever(unused);
}

static void live_well(void *unused)
{
    (void)unused;
    begins++;
    for (;;) {
        Sys_Sleep(4);
        (void)Sys_Feed_Watchdog();
    }
}

static void services_are_restarted(void)
{
    static const sys_process_config brief_one = {end_at_once, NULL, 0, 0, 0, 0, 0};
    static const sys_process_config busy_one = {never_yield, NULL, 0, 0, 0, 0, 0};
    static const sys_process_config good_one = {live_well, NULL, 0, 0, 0, 0, 0};
    static sys_service few = {.config = &brief_one, .restarts = 3}, busy = {.config = &busy_one, .limit_ms = 20, .restarts = 2};
    static sys_service good = {.config = &good_one, .limit_ms = 20, .restarts = SYS_ALWAYS};
    static sys_service storm = {.config = &brief_one, .restarts = SYS_ALWAYS};
    CHECK(refused_as(Sys_Feed_Watchdog(), SYS_ERROR_PROCESS));
    begins = 0;
    CHECK(Sys_Start_Service(&few));
    Sys_Sleep(100);
    CHECK(begins == 4 && few.pid == 0);
    begins = 0;
    CHECK(Sys_Start_Service(&busy) && refused_as(Sys_Start_Service(&busy), SYS_ERROR_PROCESS));
    Sys_Sleep(200);
    CHECK(begins == 3 && busy.bitten == 3 && busy.pid == 0);
    begins = 0;
    few.restarts = 1;
    CHECK(Sys_Start_Service(&few)); /* restart after its end */
    Sys_Sleep(60);
    CHECK(begins == 2);
    begins = 0;
    CHECK(Sys_Start_Service(&good));
    Sys_Sleep(100);
    CHECK(begins == 1 && good.bitten == 0 && Sys_Kill_Process(good.pid));
    Sys_Sleep(20);
    CHECK(begins == 2 && good.bitten == 0);
    begins = 0;
    CHECK(Sys_Start_Service(&storm));
    uint16 heap = heap_now();
    Sys_Sleep(200); /* the service ends and restarts repeatedly; others run */
    uint16 pid = start(spin_for_ever, NULL, 0);
    rounds_spun = 0;
    Sys_Sleep(50);
    CHECK(begins > 5 && rounds_spun != 0 && Sys_Kill_Process(pid));
    storm.restarts = good.restarts = 0;
    CHECK(Sys_Kill_Process(good.pid));
    Sys_Sleep(30);
    CHECK(storm.pid == 0 && good.pid == 0 && heap_now() <= heap);
}

static void a_service_reports_its_wrong_configuration(void)
{
    static const sys_process_config wrong = {end_at_once, NULL, 10, 0, 0, 0, 0};
    static sys_service service = {.config = &wrong, .restarts = 1};
    CHECK(refused_as(Sys_Start_Service(&service), SYS_ERROR_ARGUMENT));
}

static void take_all_memory(void *unused)
{
    begins++;
    for (uint16 id = 0x100; Sys_Register_Event(id); id++) {
    }
    spin_for_ever(unused);
}

static void a_service_that_takes_all_memory_is_restarted(void)
{
    static const sys_process_config greedy = {take_all_memory, NULL, 0, 0, 0, 0, 0};
    static sys_service service = {.config = &greedy, .limit_ms = 20, .restarts = 2};
    uint16 heap = heap_now();
    begins = 0;
    CHECK(Sys_Start_Service(&service));
    Sys_Sleep(200);
    CHECK(begins == 3 && service.bitten == 3 && service.pid == 0);
    for (uint16 id = 0x100; Sys_Unregister_Event(id); id++) {
    }
    CHECK(heap_now() <= heap);
}

void check_limits(void)
{
    quotas_bound_what_waits();
    quotas_come_and_go();
    a_handler_ends_its_limited_event();
    a_quota_counts_the_current_delivery();
    a_service_reports_its_wrong_configuration();
    a_service_that_takes_all_memory_is_restarted();
    services_are_restarted();
}
