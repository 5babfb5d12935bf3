/* What any port must get right, with nothing but the public interface and time that passes by itself. Prints one line per
 * check that fails; exit status 0 = the port conforms. */
#include "openswarm.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { E1 = SYS_FIRST_USER_EVENT, E2 };

static int failures;
static void check(bool holds, const char *what)
{
    if (!holds) {
        failures++;
        printf("does not conform: %s\n", what);
    }
}

static volatile uint32 spins[2];
static void spin(void *which)
{
    for (;;) {
        (void)Sys_Get_SystemTime();
        ++*(volatile uint32 *)which;
    }
}

static void threads_are_preempted(void)
{
    sys_process_config a = {spin, (void *)&spins[0], 0, 0, 0, 0, 0}, b = {spin, (void *)&spins[1], 0, 0, 0, 0, 0};
    uint16 heap = Sys_Get_Statistics()->heap_used;
    uint16 pid_a = Sys_Start_ProcessWith(&a), pid_b = Sys_Start_ProcessWith(&b);
    check(pid_a != 0 && pid_b != 0 && pid_a != pid_b, "threads get PIDs of their own");
    Sys_Sleep(100);
    check(spins[0] > 0 && spins[1] > 0, "two threads that never yield share the CPU");
    check(Sys_Kill_Process(pid_a) && Sys_Kill_Process(pid_b), "ready threads can be killed");
    check(Sys_Get_Statistics()->heap_used == heap, "killing a thread frees its memory");
}

static void sleeping_takes_its_time(void)
{
    uint32 before = Sys_Get_SystemTime();
    Sys_Sleep(25);
    uint32 slept = Sys_Get_SystemTime() - before;
    check(slept >= 25 && slept <= 26, "Sys_Sleep(25) takes 25 ms when nothing else runs");
}

static uint16 handled, handler_pid;
static bool handle(uint16 pid, uint16 event, sys_event_data *data)
{
    handler_pid = pid;
    handled = (uint16)(handled + data->value);
    Sys_Yield();     /* refused: handlers run to completion */
    Sys_Sleep(10);
    check(Sys_Get_LastError() == SYS_ERROR_CONTEXT, "a handler may not block");
    return event == E1 && handled < 3;
}

static void handlers_run_between_threads(void)
{
    Sys_Register_Event(E1);
    check(Sys_Subscribe_to_Event(E1, 0, handle, NULL), "subscription");
    Sys_Send_IntEvent(E1, 1);
    check(handled == 0, "a handler does not interrupt the sender");
    Sys_Yield();
    check(handled == 1 && handler_pid == 0, "a handler runs at the next switch");
    Sys_Send_IntEvent(E1, 2);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 4);
    Sys_Yield();
    check(handled == 3, "a handler that returned false is unsubscribed");
    check(Sys_Unregister_Event(E1), "unregister");
}

static char order[16];
static void wait_for_e2(void)
{
    sys_event_data *data = Sys_Wait_for_Event(E2);
    order[strlen(order)] = data != NULL && data->size == 5 && memcmp(data->payload, "event", 5) == 0 ? 'w' : '?';
    Sys_Clear_EventData(&data);
    data = Sys_Wait_for_ConditionTimeout(E2, NULL, 7);
    order[strlen(order)] = data == NULL ? 't' : '?';
}

static void waits_and_timeouts(void)
{
    uint16 heap = Sys_Get_Statistics()->heap_used;
    Sys_Register_Event(E2);
    Sys_Start_Process(wait_for_e2);
    Sys_Start_Process(wait_for_e2);
    Sys_Yield();
    Sys_Send_Event(E2, "event", 5);
    Sys_Sleep(20);
    check(strcmp(order, "wwtt") == 0, "two waiters get the event, then both time out");
    Sys_Unregister_Event(E2);
    check(Sys_Get_Statistics()->heap_used == heap, "waiting leaves no memory behind");
}

static uint32 in_section;
static void spin_once(void)
{
    in_section++;
}

static void critical_sections_postpone(void)
{
    Sys_Start_Process(spin_once);
    Sys_Start_CriticalSection();
    uint32 before = Sys_Get_SystemTime();
    for (unsigned i = 0; i < 100000 && Sys_Get_SystemTime() == before; i++) {
    }
    check(in_section == 0, "no switch in a critical section");
    Sys_End_CriticalSection();
    Sys_Yield();
    check(in_section == 1, "the switch follows it");
}

int main(void)
{
    alarm(60);
    Sys_Init_Kernel();
    Sys_Start_Kernel();
    threads_are_preempted();
    sleeping_takes_its_time();
    handlers_run_between_threads();
    waits_and_timeouts();
    critical_sections_postpone();
    printf(failures == 0 ? "conforms\n" : "%d checks failed\n", failures);
    fflush(stdout);
    _exit(failures == 0 ? 0 : 1);
}
