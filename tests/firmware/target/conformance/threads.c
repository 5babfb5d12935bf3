/* Threads: switching, sleeping, killing, critical sections, schedulers. */
#include "conformance.h"

#define FILE_LETTER 't'

static volatile uint16 spins[2];
static void spin(void *which)
{
    for (;;) {
        (void)Sys_Get_SystemTime(); /* on some hosts time advances in calls only */
        ++*(volatile uint16 *)which;
    }
}

static void idle(void *unused)
{
    (void)unused;
    for (;;) {
        Sys_Yield();
    }
}

static void threads_are_preempted(void)
{
    uint16 heap = heap_now();
    uint16 a = start(spin, (void *)&spins[0], 0), b = start(spin, (void *)&spins[1], 0);
    CHECK(a != 0 && b != 0 && a != b);
    Sys_Sleep(100);
    CHECK(spins[0] > 0 && spins[1] > 0);
    CHECK(Sys_Get_UnusedStack(a) > 0 && Sys_Get_UnusedStack(a) <= SYS_DEFAULT_STACK);
    CHECK(Sys_Get_ProcessState(0) == SYS_RUNNING && Sys_Get_ProcessState(a) == SYS_READY);
    CHECK(Sys_Kill_Process(a) && Sys_Kill_Process(b));
    CHECK(Sys_Get_ProcessState(a) == SYS_UNKNOWN);
    CHECK(heap_now() == heap);
}

static void sleeping_takes_its_time(void)
{
    static const uint16 periods[] = {1, 2, 25, 300};
    for (uint16 i = 0; i < sizeof periods / sizeof *periods; i++) {
        uint32 before = Sys_Get_SystemTime();
        Sys_Sleep(periods[i]);
        uint32 slept = Sys_Get_SystemTime() - before;
        CHECK(slept >= periods[i] && slept <= periods[i] + 1u);
    }
}

static uint16 lengths[4] = {7, 3, 30, 12};
static void sleeper(void *which)
{
    Sys_Sleep(*(uint16 *)which);
    note((char)('0' + ((uint16 *)which - lengths)));
}

static void sleepers_wake_in_order(void)
{
    uint16 heap = heap_now();
    forget();
    for (uint16 i = 0; i < 4; i++) {
        CHECK(start(sleeper, &lengths[i], 0) != 0);
    }
    Sys_Sleep(60);
    CHECK(noted("1032"));
    CHECK(heap_now() == heap);
}

/* The system time never decreases and never jumps, even if one of its halves changes during the read. */
static void time_is_read_whole(void)
{
    uint16 other = start(spin, (void *)&spins[0], 0);
    uint32 before = Sys_Get_SystemTime(), begin = before;
    uint16 wrong = 0;
    while (before - begin < 600) {
        uint32 now = Sys_Get_SystemTime();
        wrong += now - before > 100;
        before = now;
    }
    CHECK(wrong == 0);
    CHECK(Sys_Kill_Process(other));
}

static void once(void *unused)
{
    (void)unused;
    note('o');
}

static void critical_sections_postpone(void)
{
    forget();
    CHECK(start(once, NULL, 0) != 0);
    uint16 refused = Sys_Get_Statistics()->refused;
    Sys_Start_CriticalSection();
    Sys_Start_CriticalSection();
    uint32 before = Sys_Get_SystemTime();
    for (uint16 i = 0; i < 60000 && Sys_Get_SystemTime() - before < 25; i++) { /* slices end in the meantime */
    }
    Sys_End_CriticalSection();
    CHECK(noted(""));
    Sys_Yield();
    Sys_Sleep(1);
    CHECK(Sys_Wait_for_Event(E1) == NULL && Sys_Get_LastError() == SYS_ERROR_CONTEXT);
    CHECK(Sys_Get_Statistics()->refused == refused + 3u);
    CHECK(noted(""));
    Sys_End_CriticalSection();
    Sys_Yield();
    CHECK(noted("o"));
}

static void pids_are_not_reused_while_alive(void)
{
    uint16 old = start(idle, NULL, 0), last = old, wrong = 0;
    for (uint16 i = 0; i < 300; i++) {
        uint16 pid = start(idle, NULL, 0);
        wrong += pid == 0 || pid == old || pid == last;
        wrong += !Sys_Kill_Process(pid);
        last = pid;
    }
    CHECK(wrong == 0);
    CHECK(Sys_Kill_Process(old) && !Sys_Kill_Process(old));
    CHECK(!Sys_Kill_Process(0) && Sys_Get_LastError() == SYS_ERROR_PROCESS);
}

static void bad_configurations_are_refused(void)
{
    sys_process_config good = {idle, NULL, 0, 0, 0, 0, 0}, bad = good;
    bad.entry = NULL;
    CHECK(Sys_Start_ProcessWith(&bad) == 0);
    bad = good;
    bad.stack = SYS_MINIMUM_STACK - HEAP_STEP;
    CHECK(Sys_Start_ProcessWith(&bad) == 0);
    bad.stack = SYS_MINIMUM_STACK + 1;
    CHECK(Sys_Start_ProcessWith(&bad) == 0);
    bad = good;
    bad.flags = SYS_PERIODIC;
    CHECK(Sys_Start_ProcessWith(&bad) == 0);
    bad.period_ms = 10;
    bad.deadline_ms = 11;
    CHECK(Sys_Start_ProcessWith(&bad) == 0);
    CHECK(Sys_Get_LastError() == SYS_ERROR_ARGUMENT);
}

static void wait_and_note(void *unused)
{
    (void)unused;
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(E1);
        note('H');
        Sys_Clear_EventData(&data);
    }
}

static void priorities_preempt(void)
{
    uint16 heap = heap_now();
    forget();
    CHECK(Sys_Register_Event(E1));
    Sys_Set_Scheduler(&sys_fixed_priority);
    uint16 pid = start(wait_and_note, NULL, 5);
    Sys_Yield();
    note('<');
    CHECK(Sys_Send_IntEvent(E1, 1));
    for (uint16 i = 0; i < 1000 && !noted("<H"); i++) { /* on some hosts the next call switches threads */
        (void)Sys_Get_SystemTime();
    }
    note('>');
    CHECK(noted("<H>"));
    Sys_Set_Scheduler(&sys_round_robin);
    CHECK(Sys_Kill_Process(pid) && Sys_Unregister_Event(E1));
    CHECK(heap_now() == heap);
}

static volatile uint16 turns, rounds;
static const uint8 *volatile latest;
static void take_turns(void *me)
{
    for (;;) {
        (void)Sys_Get_SystemTime();
        if (latest != me) {
            latest = me;
            turns++;
        }
    }
}

static void wait_for_ticks(void *unused)
{
    (void)unused;
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(SYS_1ms_TIMER);
        rounds++;
        Sys_Clear_EventData(&data);
    }
}

/* Threads of equal priority alternate every 10 ms, however often a thread of higher priority preempts them. */
static void preempted_threads_keep_their_slice(void)
{
    static const uint8 both[2];
    Sys_Set_Scheduler(&sys_fixed_priority);
    uint16 waiter = start(wait_for_ticks, NULL, 2);
    uint16 a = start(take_turns, (void *)&both[0], 0), b = start(take_turns, (void *)&both[1], 0);
    turns = rounds = 0;
    Sys_Sleep(200);
    uint16 turned = turns, waited = rounds;
    CHECK(waiter != 0 && a != 0 && b != 0);
    CHECK(waited >= 150);
    CHECK(turned >= 5 && turned <= 40);
    Sys_Set_Scheduler(&sys_round_robin);
    CHECK(Sys_Kill_Process(waiter) && Sys_Kill_Process(a) && Sys_Kill_Process(b));
}

static volatile uint16 met, missed;
static uint8 late_ones;
static void job(void *late)
{
    for (;;) {
        uint32 begin = Sys_Get_SystemTime();
        while (late != NULL && Sys_Get_SystemTime() - begin < 8) {
        }
        if (Sys_Wait_for_Period()) {
            met++;
        } else {
            missed++;
        }
    }
}

static uint16 start_job(void *late, uint16 deadline)
{
    sys_process_config config = {job, late, 0, 0, SYS_PERIODIC, 20, deadline};
    return Sys_Start_ProcessWith(&config);
}

static void deadlines_are_met_and_missed(void)
{
    uint16 before = Sys_Get_Statistics()->deadlines_missed;
    Sys_Set_Scheduler(&sys_earliest_deadline);
    uint16 good = start_job(NULL, 20);
    Sys_Sleep(210);
    CHECK(met >= 9 && met <= 11 && missed == 0);
    CHECK(Sys_Kill_Process(good));
    uint16 bad = start_job(&late_ones, 3); /* 8 ms of work with a deadline after 3 ms */
    Sys_Sleep(110);
    CHECK(missed >= 4);
    CHECK(Sys_Get_Statistics()->deadlines_missed - before >= missed);
    CHECK(Sys_Kill_Process(bad));
    Sys_Set_Scheduler(&sys_round_robin);
}

void check_threads(void)
{
    threads_are_preempted();
    sleeping_takes_its_time();
    sleepers_wake_in_order();
    time_is_read_whole();
    critical_sections_postpone();
    pids_are_not_reused_while_alive();
    bad_configurations_are_refused();
    priorities_preempt();
    preempted_threads_keep_their_slice();
    deadlines_are_met_and_missed();
}
