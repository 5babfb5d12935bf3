/* The kernel's options in use, one scene per run; the test reads the counters. */
#include <openswarm.h>
#include <openswarm_cleanup.h>
#include <openswarm_join.h>
#include <openswarm_mutex.h>
#include <openswarm_quota.h>
#include <openswarm_service.h>

enum { MUTEX, NO_MUTEX, LATEST, NO_LATEST, ENDS, INTERRUPTS };

volatile uint16 scene __attribute__((used));
volatile uint16 waited_ms __attribute__((used)), commands __attribute__((used)), ticks __attribute__((used));
volatile uint16 zombies __attribute__((used)), joined __attribute__((used)), cleaned __attribute__((used));
volatile uint16 service_starts __attribute__((used)), done __attribute__((used));

static void busy(uint16 ms)
{
    uint32 begin = Sys_Get_SystemTime();
    while (Sys_Get_SystemTime() - begin < ms) {
    }
}

static void start(void (*entry)(void *), uint8 priority, uint16 period)
{
    sys_process_config config = {entry, NULL, 0, priority, period != 0 ? SYS_PERIODIC : 0, period, period};
    SYS_ASSERT(Sys_Start_ProcessWith(&config) != 0);
}

/* ---- Priority inversion: without the mutex a flag that the high thread polls ----------------------------------------- */

static sys_mutex mutex = SYS_MUTEX(3);
static volatile bool taken;

__attribute__((noinline, used)) void enter(void)
{
    if (scene != NO_MUTEX) {
        SYS_ASSERT(Sys_Lock_Mutex(&mutex));
    } else {
        while (taken) {
            Sys_Sleep(1);
        }
        taken = true;
    }
}

__attribute__((noinline, used)) void leave(void)
{
    if (scene != NO_MUTEX) {
        SYS_ASSERT(Sys_Unlock_Mutex(&mutex));
    } else {
        taken = false;
    }
}

static void low(void *unused)
{
    (void)unused;
    enter();
    busy(12);
    leave();
}

static void middle(void *unused)
{
    (void)unused;
    Sys_Sleep(5);
    busy(2000);
}

static void high(void *unused)
{
    (void)unused;
    Sys_Sleep(5);
    uint32 begin = Sys_Get_SystemTime();
    enter();
    waited_ms = (uint16)(Sys_Get_SystemTime() - begin);
    leave();
    done = 1;
}

/* ---- A handler of 1.5 ms for the event of every ms ------------------------------------------------------------------- */

static bool slow(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    for (uint16 i = 0; i < 2200; i++) { /* about 10 cycles per iteration */
        __asm__ volatile("repeat #5\n\tnop");
    }
    ticks++;
    return true;
}

static void command(void *unused)
{
    (void)unused;
    for (;;) {
        commands++;
        (void)Sys_Wait_for_Period();
    }
}

/* ---- Ends of threads: join, cleanup, service --------------------------------------------------------------------- */

static void count(void *counter)
{
    ++*(volatile uint16 *)counter;
}

__attribute__((noinline, used)) void push(void)
{
    static sys_cleanup cleanup;
    SYS_ASSERT(Sys_Push_Cleanup(&cleanup, count, (void *)&cleaned));
}

__attribute__((noinline, used)) void feed(void)
{
    SYS_ASSERT(Sys_Feed_Watchdog());
}

static void brief(void *unused)
{
    (void)unused;
    push();
    Sys_Sleep(2);
}

static void hang(void *unused)
{
    (void)unused;
    service_starts++;
    feed();
    for (;;) {
    }
}

static void watch_ends(void *unused)
{
    static const sys_process_config config = {brief, NULL, 0, 0, 0, 0, 0}, hanging = {hang, NULL, 0, 0, 0, 0, 0};
    static sys_service service = {.config = &hanging, .limit_ms = 50, .restarts = 2};
    (void)unused;
    uint16 pid = Sys_Start_Joinable(&config);
    Sys_Sleep(5);
    zombies += Sys_Get_ProcessState(pid) == SYS_ZOMBIE;
    joined += Sys_Join(pid) && Sys_Get_ProcessState(pid) == SYS_UNKNOWN;
    pid = Sys_Start_Joinable(&config);
    joined += Sys_Join(pid);
    pid = Sys_Start_Joinable(&config);
    Sys_Yield();
    SYS_ASSERT(Sys_Kill_Process(pid));
    joined += Sys_Join(pid);
    SYS_ASSERT(Sys_Start_Service(&service));
    Sys_Sleep(400);
    done = 1;
}

/* ---- Every call from an interrupt, while a thread owns a mutex and another waits for it, one joins and one is limited -- */

volatile uint16 interrupts __attribute__((used)), wrong __attribute__((used)), rounds __attribute__((used));
static uint16 partner;
static sys_quota two;

__attribute__((used)) void from_interrupt(void)
{
    static sys_quota none;
    static sys_cleanup cleanup;
    static sys_service service;
    static const sys_process_config config = {count, NULL, 0, 0, 0, 0, 0};
    uint16 refused = Sys_Get_Statistics()->refused;
    wrong += Sys_Lock_Mutex(&mutex) + Sys_Lock_MutexTimeout(&mutex, 1) + Sys_Unlock_Mutex(&mutex);
    wrong += (Sys_Start_Joinable(&config) != 0) + Sys_Join(partner);
    wrong += Sys_Push_Cleanup(&cleanup, count, NULL) + Sys_Pop_Cleanup(true);
    wrong += Sys_Limit_Event(&none, SYS_FIRST_USER_EVENT, 1) + Sys_Keep_Latest(&none, SYS_FIRST_USER_EVENT);
    wrong += Sys_Start_Service(&service) + Sys_Feed_Watchdog();
    wrong += Sys_Get_LastError() != SYS_ERROR_CONTEXT || (uint16)(Sys_Get_Statistics()->refused - refused) != 11;
    wrong += !Sys_Send_IntEvent(SYS_FIRST_USER_EVENT, ++interrupts);
}

static bool newest(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    wrong += data->value > interrupts;
    ticks++;
    return true;
}

static void lock_and_unlock(void *unused)
{
    (void)unused;
    for (;;) {
        enter();
        Sys_Yield();
        leave();
        rounds++;
    }
}

static void join_for_ever(void *unused)
{
    static const sys_process_config config = {brief, NULL, 0, 0, 0, 0, 0};
    (void)unused;
    for (;;) {
        partner = Sys_Start_Joinable(&config);
        wrong += !Sys_Join(partner);
        joined++;
    }
}

/* Breakpoint of the test, which sets `scene` here. */
__attribute__((noinline, used)) void begin(void)
{
    __asm__ volatile("nop" ::: "memory");
}

int main(void)
{
    static sys_quota quota;
    Sys_Init_Kernel();
    begin();
    if (scene <= NO_MUTEX) {
        Sys_Set_Scheduler(&sys_fixed_priority);
        start(low, 1, 0);
        start(middle, 2, 0);
        start(high, 3, 0);
    } else if (scene <= NO_LATEST) {
        SYS_ASSERT(scene == NO_LATEST || Sys_Keep_Latest(&quota, SYS_1ms_TIMER));
        SYS_ASSERT(Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, slow, NULL));
        start(command, 0, 10);
    } else if (scene == INTERRUPTS) {
        SYS_ASSERT(Sys_Register_Event(SYS_FIRST_USER_EVENT) && Sys_Keep_Latest(&two, SYS_FIRST_USER_EVENT));
        SYS_ASSERT(Sys_Subscribe_to_Event(SYS_FIRST_USER_EVENT, 0, newest, NULL));
        start(lock_and_unlock, 0, 0);
        start(lock_and_unlock, 0, 0);
        start(join_for_ever, 0, 0);
    } else {
        start(watch_ends, 0, 0);
    }
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
