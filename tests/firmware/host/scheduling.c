/* Schedulers other than round robin, and preemption in real time (openswarm.h, openswarm_scheduler.h). */
#include "test.h"

#include "openswarm_semaphore.h"

/* ---- Earliest deadline first ---------------------------------------------------------------------------------- */

static int met[3], missed[3];
static void job(void *which)
{
    int me = *(int *)which;
    for (;;) {
        for (int ms = 0; ms <= me * 2; ms++) { /* 1, 3 or 5 ms of work for job 0, 1 or 2 */
            host_tick();
            note((char)('a' + me));
        }
        if (Sys_Wait_for_Period()) {
            met[me]++;
        } else {
            missed[me]++;
        }
    }
}
static int indices[3] = {0, 1, 2};

static void start_job(int i, uint16 period, uint16 deadline)
{
    sys_process_config config = {job, &indices[i], 0, 0, SYS_PERIODIC, period, deadline};
    CHECK(Sys_Start_ProcessWith(&config) != 0);
}

static uint16 miss_pid;
static bool on_miss(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    miss_pid = data->value;
    deliveries++;
    return true;
}

TEST(earliest_deadline_first_meets_every_deadline_of_a_feasible_set, "kernel.md §2: EDF")
{
    boot();
    Sys_Set_Scheduler(&sys_earliest_deadline);
    start_job(0, 5, 5);   /* total load: 1/5 + 3/10 + 5/20 = 0.75 */
    start_job(1, 10, 10);
    start_job(2, 20, 20);
    Sys_Sleep(1000);
    CHECK_EQ(missed[0] + missed[1] + missed[2], 0);
    CHECK(met[0] >= 198 && met[1] >= 98 && met[2] >= 48);
    CHECK_EQ(Sys_Get_Statistics()->deadlines_missed, 0);
}

TEST(a_missed_deadline_is_counted_and_reported, "kernel.md §2: a miss is counted and reported by event")
{
    boot();
    Sys_Register_Event(SYS_DEADLINE_MISSED);
    Sys_Subscribe_to_Event(SYS_DEADLINE_MISSED, 0, on_miss, NULL);
    Sys_Set_Scheduler(&sys_earliest_deadline);
    start_job(2, 50, 3); /* 5 ms of work with a deadline after 3 ms */
    Sys_Sleep(100);
    CHECK(missed[2] >= 1);
    CHECK(deliveries >= 1);
    CHECK_EQ(miss_pid, 1);
    CHECK_EQ(Sys_Get_Statistics()->deadlines_missed, deliveries);
}

static void job_without_end(void *unused)
{
    (void)unused;
    for (uint16 ms = 1;; ms++) {
        host_tick();
        if (ms % 10 == 0) {
            host_slice();
        }
    }
}

TEST(a_late_job_starves_no_thread, "openswarm.h: sys_earliest_deadline; once it ran alone for as long as it was late")
{
    sys_process_config endless = {job_without_end, NULL, 0, 0, SYS_PERIODIC, 100, 50};
    boot();
    Sys_Set_Scheduler(&sys_earliest_deadline);
    CHECK(Sys_Start_ProcessWith(&endless) != 0);
    start_job(0, 5, 5);
    for (uint32 end = 4000; Sys_Get_SystemTime() < end;) {
        Sys_Sleep(500); /* a thread without a period: it must still be scheduled */
    }
    CHECK(met[0] >= 790);
    CHECK_EQ(missed[0], 0);
    CHECK_EQ(Sys_Get_Statistics()->deadlines_missed, 1);
}

static void wait_note_h(void)
{
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(E1);
        note('H');
        Sys_Clear_EventData(&data);
    }
}

TEST(an_event_preempts_a_lower_priority_thread_at_once, "openswarm_scheduler.h: eager")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Set_Scheduler(&sys_fixed_priority);
    sys_process_config high = {((void (*)(void *))(void *)wait_note_h), NULL, 0, 5, 0, 0, 0};
    Sys_Start_ProcessWith(&high);
    Sys_Yield();
    note('<');
    Sys_Send_IntEvent(E1, 1);
    note('>');
    CHECK(strcmp(trace, "<H>") == 0);
}

/* ---- Preemption in real time ---------------------------------------------------------------------------------- */

static volatile unsigned long spins[2];
static void spin(void *which)
{
    for (;;) {
        ++*(volatile unsigned long *)which;
    }
}

TEST(a_signal_preempts_threads_that_never_call_the_kernel, "port/posix/README.md: real time; engines.md §6: 10 ms slices")
{
    sys_process_config a = {spin, (void *)&spins[0], 0, 0, 0, 0, 0}, b = {spin, (void *)&spins[1], 0, 0, 0, 0, 0};
    Sys_Init_Kernel();
    CHECK(Sys_Start_ProcessWith(&a) != 0 && Sys_Start_ProcessWith(&b) != 0);
    Sys_Start_Kernel();
    while (spins[0] == 0 || spins[1] == 0) { /* PID 0 spins, too; if the test fails, the alarm of main.c ends it */
    }
    unsigned long before = spins[1];
    while (spins[1] == before) {
    }
    CHECK(Sys_Get_SystemTime() > 0);
}

/* ---- Time slices ---------------------------------------------------------------------------------------------- */

static void tick_for_ever(void *c)
{
    for (;;) {
        note(*(const char *)c);
        host_tick();
    }
}

static void wait_for_every_tick(void *unused)
{
    (void)unused;
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(SYS_1ms_TIMER);
        note('.');
        Sys_Clear_EventData(&data);
    }
}

static uint16 start_with(void (*entry)(void *), const char *arg, uint8 priority)
{
    sys_process_config config = {entry, (void *)arg, 0, priority, 0, 0, 0};
    return Sys_Start_ProcessWith(&config);
}

TEST(a_preempted_thread_keeps_the_rest_of_its_slice, "hal_cpu.h: hal_slice_restart(); each tick once handed the CPU on")
{
    boot();
    Sys_Set_Scheduler(&sys_fixed_priority);
    os_system.priority = 3;
    uint16 waiter = start_with(wait_for_every_tick, NULL, 2), a = start_with(tick_for_ever, "a", 1);
    uint16 b = start_with(tick_for_ever, "b", 1);
    CHECK(waiter != 0 && a != 0 && b != 0);
    Sys_Sleep(6);
    CHECK(strcmp(trace, "a.a.a.a.a.a") == 0); /* afterwards PID 0 has the higher priority */
    CHECK_EQ(process_find(a)->event_or_slice.spent, 6);
    CHECK_EQ(process_find(b)->event_or_slice.spent, 0);
}

static void yield_between_ticks(void *c)
{
    for (;;) {
        note(*(const char *)c);
        host_tick();
        Sys_Yield();
    }
}

TEST(a_yield_hands_the_turn_on_beside_a_waiter, "openswarm.h: Sys_Yield")
{
    boot();
    Sys_Set_Scheduler(&sys_fixed_priority);
    os_system.priority = 3;
    start_with(wait_for_every_tick, NULL, 2);
    start_with(yield_between_ticks, "a", 1);
    start_with(yield_between_ticks, "b", 1);
    Sys_Sleep(4);
    CHECK(strcmp(trace, "a.b.a.b") == 0);
}

static void end_slice_of_preempted(void *c)
{
    for (;;) {
        note(*(const char *)c);
        Sys_Start_CriticalSection();
        host_tick();
        host_slice(); /* the slice ends in the same section: the switch is forced, and the slice is used up */
        Sys_End_CriticalSection();
    }
}

TEST(a_slice_that_is_over_and_preempted_is_over, "hal_cpu.h: hal_slice_is_over()")
{
    boot();
    Sys_Set_Scheduler(&sys_fixed_priority);
    os_system.priority = 3;
    start_with(wait_for_every_tick, NULL, 2);
    start_with(end_slice_of_preempted, "a", 1);
    start_with(end_slice_of_preempted, "b", 1);
    Sys_Sleep(4);
    CHECK(strcmp(trace, "a.b.a.b") == 0);
}

static void send_while_kernel_works(void)
{
    Sys_Send_IntEvent(E1, 1);
}
static bool interrupted_handler(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    host_device(send_while_kernel_works);
    return true;
}

TEST(an_interrupt_during_handlers_preempts_behind_them, "openswarm_scheduler.h: eager; its message once waited for the next tick")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Register_Event(E2);
    Sys_Subscribe_to_Event(E2, 0, interrupted_handler, NULL);
    Sys_Set_Scheduler(&sys_fixed_priority);
    sys_process_config high = {((void (*)(void *))(void *)wait_note_h), NULL, 0, 5, 0, 0, 0};
    Sys_Start_ProcessWith(&high);
    Sys_Yield();
    note('<');
    Sys_Send_IntEvent(E2, 1);
    note('>');
    CHECK(strcmp(trace, "<H>") == 0);
}

static bool send_from_handler(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    Sys_Send_IntEvent(E1, 1);
    return true;
}

TEST(what_a_handler_sends_preempts_at_the_next_tick, "openswarm_scheduler.h: eager; it once waited for the end of the slice")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Register_Event(E2);
    Sys_Subscribe_to_Event(E2, 0, send_from_handler, NULL);
    Sys_Set_Scheduler(&sys_fixed_priority);
    sys_process_config high = {((void (*)(void *))(void *)wait_note_h), NULL, 0, 5, 0, 0, 0};
    Sys_Start_ProcessWith(&high);
    Sys_Yield();
    Sys_Send_IntEvent(E2, 1);
    note('<');
    host_tick();
    note('>');
    CHECK(strcmp(trace, "<H>") == 0);
}

static void note_t(void)
{
    note('T');
}

TEST(round_robin_withdraws_a_request_to_choose, "openswarm_scheduler.h: NULL; on posix, AVR and Cortex-M it once switched for ever")
{
    static const sys_scheduler eager_without_pick = {NULL, true};
    boot();
    Sys_Set_Scheduler(&sys_fixed_priority);
    Sys_Start_CriticalSection();
    Sys_Start_Process(note_t);
    Sys_Set_Scheduler(&sys_round_robin);
    Sys_End_CriticalSection();
    note('<');
    Sys_Set_Scheduler(&eager_without_pick);
    Sys_Start_Process(note_t);
    note('>');
    Sys_Yield();
    Sys_Yield();
    CHECK(strcmp(trace, "<>TT") == 0);
}

static sys_semaphore unit = SYS_SEMAPHORE(0);

static void note_unit(void)
{
    CHECK(Sys_Wait_for_Semaphore(&unit));
    note('U');
}

TEST(a_signal_outside_a_section_preempts_at_once, "openswarm_semaphore.h; on posix it once waited for the next call")
{
    boot();
    Sys_Set_Scheduler(&sys_woken_first);
    Sys_Start_Process(note_unit);
    Sys_Yield();
    CHECK(Sys_Signal_Semaphore(&unit));
    note('>');
    CHECK(strcmp(trace, "U>") == 0);
}
