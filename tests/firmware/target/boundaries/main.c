/* A round of all kernel calls that restores everything it changes. An interrupt at a boundary chosen by the harness
 * makes every call that an ISR may make and every call that it may not make. See README.md. */
#include "boundaries.h"

#include <openswarm_cleanup.h>
#include <openswarm_io.h>
#include <openswarm_join.h>
#include <openswarm_mutex.h>
#include <openswarm_quota.h>
#include <openswarm_service.h>

#include <string.h>

enum { HEARD = SYS_FIRST_USER_EVENT, SILENT, WAITED, SHARED = SYS_FIRST_USER_EVENT + 8 /* HEARD's bucket */, NEVER };

volatile uint16 failures, first_failure; /* number of calls with an unexpected result; source line of the first */
volatile uint16 interrupts, sent, isr_sent, heard, ticks, rounds;
static uint16 driver_pid, waiter_pid;
static volatile uint16 woken;

static void fail(uint16 line)
{
    if (failures++ == 0) {
        first_failure = line;
    }
}
#define MUST(condition) ((condition) ? (void)0 : fail(__LINE__))

#define STOP(name)                                                    \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        __asm__ volatile("nop" ::: "memory");                         \
    }

STOP(round_begin)
STOP(round_end)

static bool hear(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    heard++;
    MUST(data->size == 2 ? data->value == 7 : data->size == 5 && memcmp(data->payload, "event", 5) == 0);
    return true;
}

static bool tick(uint16 pid, uint16 event, sys_event_data *data)
{
    static uint16 last;
    (void)pid, (void)event;
    MUST(ticks == 0 || data->value == (uint16)(last + 1u)); /* no tick is lost or duplicated */
    last = data->value;
    ticks++;
    return true;
}

static bool other(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    return false;
}


static sys_mutex mutex = SYS_MUTEX(2);
static sys_quota quota, no_quota;
static sys_cleanup cleanup;
static sys_service service;

static void options_are_refused(void)
{
    static const sys_process_config config;
    uint16 refused = Sys_Get_Statistics()->refused;
    MUST(!Sys_Lock_Mutex(&mutex) && !Sys_Unlock_Mutex(&mutex));
    MUST(Sys_Start_Joinable(&config) == 0 && !Sys_Join(driver_pid));
    MUST(!Sys_Push_Cleanup(&cleanup, NULL, NULL) && !Sys_Pop_Cleanup(true));
    MUST(!Sys_Limit_Event(&no_quota, HEARD, 0) && !Sys_Keep_Latest(&no_quota, HEARD));
    MUST(!Sys_Start_Service(&service) && !Sys_Feed_Watchdog());
    MUST(refused > UINT16_MAX - 10 || Sys_Get_Statistics()->refused - refused == 10);
}

__attribute__((used)) void boundaries_isr(void)
{
    static const sys_process_config config;
    static const uint16 seven = 7;
    static uint8 large[SYS_SMALL_PAYLOAD + 1];
    uint16 refused = Sys_Get_Statistics()->refused;
    interrupts++;
    isr_sent += Sys_Send_Event(HEARD, &seven, sizeof seven);
    MUST(Sys_IsEventRegistered(HEARD) && !Sys_IsEventRegistered(NEVER));
    isr_sent += Sys_Send_Event(HEARD, "event", 5);
    MUST(!Sys_Send_IntEvent(NEVER, 1));
    (void)Sys_Send_IntEvent(SHARED, 1); /* the event may be registered at this moment */
    (void)Sys_Send_IntEvent(WAITED, 2); /* a value that the waiter's condition rejects */
    Sys_End_CriticalSection(); /* no effect in an ISR, like the next call */
    Sys_Start_CriticalSection();
    Sys_Start_CriticalSection();
    (void)Sys_Get_ProcessID();
    MUST(Sys_Get_ProcessState(NEVER) == SYS_UNKNOWN);
    (void)Sys_Get_ProcessState(driver_pid);
    (void)Sys_Get_SystemTime();
    (void)Sys_Get_LastError();
    MUST(Sys_Get_LostEvents(SILENT) == 0);
    Sys_Set_Scheduler(&sys_round_robin);
    MUST(!Sys_Send_Event(HEARD, large, sizeof large)); /* a payload too large for an ISR */
    MUST(!Sys_Register_Event(NEVER) && !Sys_Unregister_Event(HEARD));
    MUST(!Sys_Subscribe_to_Event(HEARD, 0, other, NULL) && !Sys_Unsubscribe_from_Event(HEARD, 0));
    MUST(!Sys_Kill_Process(driver_pid) && Sys_Start_ProcessWith(&config) == 0);
    MUST(Sys_Wait_for_Event(HEARD) == NULL);
    Sys_Sleep(1);
    Sys_Yield();
    MUST(refused > UINT16_MAX - 11 || Sys_Get_Statistics()->refused - refused == 11); /* the counter saturates */
    options_are_refused();
}

static bool is_one(sys_event_data *data)
{
    return data->value == 1;
}

static void waiter(void *unused)
{
    (void)unused;
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Condition(WAITED, is_one);
        MUST(data != NULL && data->value == 1);
        woken++;
        Sys_Clear_EventData(&data);
        MUST(data == NULL);
    }
}

static void short_lived(void *unused)
{
    (void)unused;
    Sys_Yield();
}

static void lists(void)
{
    static const uint16 seven = 7;
    MUST(Sys_Register_Event(SHARED) && Sys_IsEventRegistered(SHARED));
    MUST(Sys_Limit_Event(&quota, SHARED, 1));
    MUST(Sys_Subscribe_to_Event(SHARED, driver_pid, other, NULL));
    MUST(Sys_Subscribe_to_Event(HEARD, driver_pid, other, is_one));
    MUST(Sys_Subscribe_to_Event(SYS_1ms_TIMER, driver_pid, other, is_one));
    sent += Sys_Send_Event(HEARD, &seven, sizeof seven);
    sent += Sys_Send_Event(HEARD, "event", 5);
    MUST(Sys_Send_IntEvent(SILENT, 1));
    (void)Sys_Unsubscribe_Handler(SYS_1ms_TIMER, driver_pid, other);
    (void)Sys_Unsubscribe_Handler(HEARD, driver_pid, other);
    MUST(Sys_Unregister_Event(SHARED) && !Sys_IsEventRegistered(SHARED));
}

static void threads(void)
{
    static const sys_process_config config = {short_lived, NULL, 0, 1, 0, 0, 0};
    uint16 before = woken;
    uint16 pid = Sys_Start_ProcessWith(&config);
    MUST(pid != 0);
    (void)Sys_Get_ProcessState(pid); /* the thread may have ended already; so below */
    Sys_Yield();
    Sys_Set_Scheduler(&sys_fixed_priority);
    Sys_Yield();
    Sys_Set_Scheduler(&sys_round_robin);
    (void)Sys_Kill_Process(pid);
    MUST(Sys_Get_ProcessState(pid) == SYS_UNKNOWN);
    MUST(Sys_Send_IntEvent(WAITED, 1));
    for (uint8 i = 0; i < 4; i++) {
        Sys_Yield();
    }
    MUST(woken == (uint16)(before + 1u));
    MUST(Sys_Wait_for_ConditionTimeout(SILENT, NULL, 1) == NULL);
    Sys_Sleep(1);
    Sys_Start_CriticalSection();
    Sys_Sleep(1); /* refused */
    Sys_End_CriticalSection();
}

static void clean(void *unused)
{
    (void)unused;
}

static void options(void)
{
    static const sys_process_config config = {short_lived, NULL, 0, 0, 0, 0, 0};
    MUST(Sys_Lock_Mutex(&mutex) && Sys_Push_Cleanup(&cleanup, clean, NULL));
    MUST(Sys_Pop_Cleanup(true) && Sys_Unlock_Mutex(&mutex));
    uint16 pid = Sys_Start_Joinable(&config);
    MUST(pid != 0 && Sys_Join(pid) && Sys_Get_ProcessState(pid) == SYS_UNKNOWN);
}

/* Returns the smallest heap use of three rounds: a recent tick occupies a message until it is delivered. */
static uint16 heap_at_rest(void)
{
    uint16 least = UINT16_MAX;
    for (uint8 i = 0; i < 3; i++) {
        Sys_Yield();
        uint16 used = Sys_Get_Statistics()->heap_used;
        least = used < least ? used : least;
    }
    return least;
}

static void driver(void *unused)
{
    (void)unused;
    for (;;) {
        Sys_Sleep(1);
        Sys_Sleep(1); /* until messages of the previous round are delivered */
        uint16 heap = heap_at_rest();
        sent = isr_sent = heard = 0;
        rounds++;
        round_begin();
        lists();
        threads();
        options();
        round_end();
        Sys_Sleep(1);
        Sys_Sleep(1);
        MUST(sent == 2 && heard == sent + isr_sent);
        MUST(heap_at_rest() == heap);
    }
}

int main(void)
{
    static const sys_process_config driver_config = {driver, NULL, SYS_DEFAULT_STACK + 64, 0, 0, 0, 0};
    static const sys_process_config waiter_config = {waiter, NULL, 0, 0, 0, 0, 0};
    Sys_Init_Kernel();
    MUST(Sys_Register_Event(HEARD) && Sys_Register_Event(SILENT) && Sys_Register_Event(WAITED));
    MUST(Sys_Register_Event(SHARED) && Sys_Limit_Event(&quota, SHARED, 1) && Sys_Unregister_Event(SHARED));
    driver_pid = Sys_Start_ProcessWith(&driver_config);
    waiter_pid = Sys_Start_ProcessWith(&waiter_config);
    MUST(driver_pid != 0 && waiter_pid != 0);
    MUST(Sys_Subscribe_to_Event(HEARD, 0, hear, NULL) && Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, tick, NULL));
    inject_init();
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
