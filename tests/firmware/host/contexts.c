/* Permitted contexts of each call, and the reported errors of refused calls (openswarm.h). */
#include "test.h"

#include "openswarm_io.h"
#include "openswarm_quota.h"
#include "openswarm_semaphore.h"
#include "openswarm_timer.h"

static sys_event_data *refused_wait;
static bool blocking_condition(sys_event_data *data)
{
    (void)data;
    refused_wait = Sys_Wait_for_Event(E1);
    Sys_Sleep(3);
    return true;
}

TEST(blocking_calls_are_refused_outside_threads, "kernel.md §2: handler, ISR, condition and critical section")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_delivery, blocking_condition);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(deliveries, 1);
    CHECK(refused_wait == NULL);
    CHECK_EQ(Sys_Get_Statistics()->refused, 2);
    CHECK_EQ(Sys_Get_LastError(), SYS_OK);
    Sys_Start_CriticalSection();
    CHECK(Sys_Wait_for_Event(E1) == NULL);
    Sys_Sleep(1);
    Sys_Yield();
    Sys_End_CriticalSection();
    CHECK_EQ(Sys_Get_Statistics()->refused, 5);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_CONTEXT);
}

TEST(blocking_calls_are_refused_before_the_start, "openswarm.h: what may block is refused before Sys_Start_Kernel")
{
    host_use_virtual_time();
    Sys_Init_Kernel();
    CHECK(Sys_Wait_for_Event(SYS_1ms_TIMER) == NULL);
    CHECK(Sys_Wait_for_ConditionTimeout(SYS_1ms_TIMER, NULL, 1) == NULL);
    CHECK(!Sys_Wait_for_Period());
    Sys_Sleep(1);
    Sys_Sleep(0);
    Sys_Yield();
    Sys_Run_SystemThread();
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_CONTEXT);
    CHECK_EQ(Sys_Get_Statistics()->refused, 7);
    Sys_Start_CriticalSection();
    Sys_End_CriticalSection();
    Sys_Sleep(1);
    CHECK_EQ(Sys_Get_Statistics()->refused, 8);
    Sys_Start_Kernel();
    Sys_Sleep(1);
    CHECK_EQ(Sys_Get_SystemTime(), 1);
    CHECK_EQ(Sys_Get_Statistics()->refused, 8);
}

static uint16 state_seen_by_isr;
static void ask_for_state(void)
{
    state_seen_by_isr = Sys_Get_ProcessState(0);
    CHECK_EQ(Sys_Get_UnusedStack(0), 0);
}

TEST(an_isr_may_not_walk_the_threads, "openswarm.h: the lists change under the slice lock only")
{
    boot();
    host_device(ask_for_state);
    CHECK_EQ(state_seen_by_isr, SYS_UNKNOWN);
    CHECK_EQ(Sys_Get_Statistics()->refused, 2);
}

static void isr_tries_everything(void)
{
    sys_process_config config = {0};
    CHECK(!Sys_Register_Event(E2) && !Sys_Unregister_Event(E1));
    CHECK(!Sys_Subscribe_to_Event(E1, 0, count_delivery, NULL) && !Sys_Unsubscribe_from_Event(E1, 0));
    CHECK(!Sys_Kill_Process(1) && Sys_Start_ProcessWith(&config) == 0);
    CHECK(Sys_Wait_for_Event(E1) == NULL);
    CHECK(Sys_IsEventRegistered(E1) && Sys_Send_IntEvent(E1, 1));
    uint8 large[SYS_SMALL_PAYLOAD + 1] = {0};
    CHECK(!Sys_Send_Event(E1, large, sizeof large));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
}

TEST(an_isr_may_send_but_not_restructure, "openswarm.h: callers of each function")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_delivery, NULL);
    host_device(isr_tries_everything);
    Sys_Yield();
    CHECK_EQ(deliveries, 1);
    CHECK(!Sys_IsEventRegistered(E2));
}

static void fail_with_memory(void)
{
    host_fail_allocation(1);
    CHECK(!Sys_Register_Event(E4));
    Sys_Yield();
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_MEMORY);
    note('m');
}
static void isr_fails(void)
{
    CHECK(!Sys_Send_IntEvent(E_NEVER, 1));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_EVENT);
}
static bool handler_fails(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    Sys_Sleep(1);
    host_device(isr_fails);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_CONTEXT);
    return true;
}

TEST(the_last_error_is_that_of_the_caller, "openswarm.h: Sys_Get_LastError")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, handler_fails, NULL);
    CHECK(!Sys_Subscribe_to_Event(E1, 0, NULL, NULL));
    host_device(isr_fails);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    Sys_Start_Process(fail_with_memory);
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    Sys_Yield();
    CHECK(strcmp(trace, "m") == 0);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    Sys_Sleep(1);
    CHECK_EQ(Sys_Get_LastError(), SYS_OK);
}

static sys_event_data *isr_sees;
static void isr_clears(void)
{
    Sys_Clear_EventData(&isr_sees);
}
static void result_held(void)
{
    sys_event_data *data = Sys_Wait_for_Event(E1);
    isr_sees = data;
    uint16 before = heap_now();
    host_device(isr_clears);
    CHECK(isr_sees == NULL);
    CHECK_EQ(heap_now(), before);
    Sys_Clear_EventData(&data);
    CHECK(heap_now() < before);
    note('c');
}

TEST(an_isr_may_not_clear_a_result, "openswarm.h: Sys_Clear_EventData")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Start_Process(result_held);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 7);
    Sys_Yield();
    Sys_Yield();
    CHECK(strcmp(trace, "c") == 0);
}

/* ---- Clearing event data ------------------------------------------------------------------------------------ */

static bool clears_its_data(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    Sys_Clear_EventData(&data);
    CHECK(data == NULL);
    deliveries++;
    return true;
}

TEST(clearing_in_a_handler_leaves_the_data_to_the_kernel, "openswarm.h: Sys_Clear_EventData")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, clears_its_data, NULL);
    Sys_Subscribe_to_Event(E1, 0, count_delivery, NULL);
    uint16 before = heap_now();
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(deliveries, 2);
    CHECK_EQ(heap_now(), before);
}

static void note_thread(void)
{
    note('t');
}

TEST(a_section_may_span_the_start_of_the_kernel, "openswarm.h: Sys_Start_Kernel")
{
    host_use_virtual_time();
    Sys_Init_Kernel();
    Sys_Set_Scheduler(&sys_fixed_priority);
    CHECK(Sys_Start_Process(note_thread) != 0);
    Sys_Start_CriticalSection();
    Sys_Start_CriticalSection();
    Sys_Start_Kernel();
    for (int i = 0; i < 30; i++) {
        host_tick();
    }
    Sys_End_CriticalSection();
    CHECK_EQ(strlen(trace), 0);
    Sys_End_CriticalSection();
    Sys_Sleep(2);
    CHECK(strcmp(trace, "t") == 0);
    CHECK_EQ(Sys_Get_Statistics()->refused, 0);
}

/* ---- Calls of interrupts ---------------------------------------------------------------------------------------- */

static void isr_with_bad_arguments(void)
{
    static sys_quota quota;
    static sys_timer timer;
    CHECK(!Sys_Limit_Event(&quota, E1, 0) && !Sys_Start_Timer(&timer, E1, 0, 0, 0));
    CHECK(!Sys_Subscribe_to_Event(E1, 0, NULL, NULL));
    CHECK(Sys_Set_TxProcessor(SYS_UART1, NULL) == NULL && Sys_Set_MotorProcessor(NULL) == NULL);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_CONTEXT);
}

TEST(an_isr_is_refused_before_its_arguments_are_examined, "openswarm.h: a call from a context that is not listed")
{
    boot();
    host_device(isr_with_bad_arguments);
    CHECK_EQ(Sys_Get_Statistics()->refused, 5);
}

static void isr_ends_sections(void)
{
    Sys_End_CriticalSection();
    Sys_End_CriticalSection();
}
static void isr_starts_a_section(void)
{
    Sys_Start_CriticalSection();
}

TEST(sections_of_an_isr_change_no_nesting, "openswarm.h: Sys_Start_CriticalSection")
{
    boot();
    CHECK(Sys_Start_Process(note_thread) != 0);
    Sys_Start_CriticalSection();
    host_device(isr_ends_sections);
    Sys_Yield();
    CHECK_EQ(Sys_Get_Statistics()->refused, 1);
    CHECK_EQ(strlen(trace), 0);
    Sys_End_CriticalSection();
    host_device(isr_starts_a_section);
    Sys_Yield();
    CHECK(strcmp(trace, "t") == 0);
    CHECK_EQ(Sys_Get_Statistics()->refused, 1);
}

/* ---- Errors and decisions of the kernel itself ------------------------------------------------------------------ */

static uint16 isr_error;
static void isr_sets_no_scheduler(void)
{
    CHECK(!Sys_Set_Scheduler(NULL));
}
static void isr_reads_its_error(void)
{
    isr_error = Sys_Get_LastError();
}

TEST(sends_of_the_kernel_change_no_last_error, "openswarm.h: Sys_Get_LastError")
{
    boot();
    CHECK(Sys_Unregister_Event(SYS_EVENT_TERMINATION) && Sys_Unregister_Event(SYS_1ms_TIMER));
    uint16 pid = Sys_Start_Process(note_thread);
    CHECK(!Sys_Subscribe_to_Event(E1, 0, NULL, NULL));
    CHECK(Sys_Kill_Process(pid));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_ARGUMENT);
    host_device(isr_sets_no_scheduler);
    host_tick();
    host_device(isr_reads_its_error);
    CHECK_EQ(isr_error, SYS_ERROR_ARGUMENT);
}

static uint16 handler_error;
static bool reads_its_error(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id, (void)data;
    handler_error = Sys_Get_LastError();
    return true;
}
static bool kills_its_thread(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)id, (void)data;
    CHECK(Sys_Kill_Process(pid));
    return false;
}

TEST(a_timer_without_event_and_an_ended_handler_are_no_errors, "openswarm.h: Sys_Get_LastError")
{
    static sys_timer timer;
    boot();
    uint16 pid = Sys_Start_Process(note_thread);
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, pid, kills_its_thread, NULL));
    CHECK(Sys_Subscribe_to_Event(E1, 0, reads_its_error, NULL) && Sys_Start_Timer(&timer, E_NEVER, 0, 1, 0));
    Sys_Sleep(2);
    CHECK(Sys_Send_IntEvent(E1, 0));
    Sys_Yield();
    CHECK_EQ(handler_error, SYS_OK);
}

static uint16 decisions;
static sys_pcb *first_ready(sys_pcb *first)
{
    decisions++;
    return first;
}

TEST(a_signal_that_is_refused_asks_no_scheduler, "openswarm_semaphore.h: Sys_Signal_Semaphore")
{
    static const sys_scheduler eager = {first_ready, true};
    static sys_semaphore full = SYS_SEMAPHORE(65535);
    boot();
    CHECK(Sys_Set_Scheduler(&eager));
    decisions = 0;
    CHECK(!Sys_Signal_Semaphore(&full));
    CHECK_EQ(decisions, 0);
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_BUSY);
}
