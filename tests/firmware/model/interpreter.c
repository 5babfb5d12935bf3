/* SPDX-License-Identifier: MIT */
/* Executes a program of kernel calls and records what each call returns. The program consists of scripts: main, and
 * those of threads, handlers, conditions, cleanups and interrupts. model/executor.py does the same with the model. */
#include "interpreter.h"

#include "kernel.h"
#include "openswarm_cleanup.h"
#include "openswarm_io.h"
#include "openswarm_join.h"
#include "openswarm_mutex.h"
#include "openswarm_notification.h"
#include "openswarm_quota.h"
#include "openswarm_remote.h"
#include "openswarm_semaphore.h"
#include "openswarm_service.h"
#include "openswarm_timer.h"

#include <string.h>

enum { MAIN, THREADS, HANDLERS = 5, CONDITIONS = 9, CLEANUPS = 12, ISRS = 15 };
enum { KIND_MAIN, KIND_THREAD, KIND_HANDLER, KIND_CONDITION, KIND_CLEANUP, KIND_ISR, KIND_FINAL };
enum { ENTRY = 0xFF, END = 0xFE, SLOTS = 4, SKIPPED = 0xEEEE, NOTHING = 0xFFFF };

#define CODE(name) name,
enum { OPERATIONS(CODE) };

typedef struct {
    uint8 code, a, b, c;
} operation;

typedef struct {
    uint8 length, answer; /* answer: what a handler or condition returns */
    const operation *operations;
} script;

const uint16 interpreter_sizes[SIZES] = {
    HEAP_STEP, sizeof(sys_pcb), sizeof(event), sizeof(subscription), sizeof(message), sizeof(periodic), SYS_DEFAULT_STACK,
    SYS_MINIMUM_STACK, SYS_SMALL_PAYLOAD, SYS_MAXIMUM_PAYLOAD, SYS_KERNEL_STACK, SYS_LOSS_COUNTERS, SYS_MAXIMUM_SPEED,
    SYS_REMOTE_EVENTS, SYS_REMOTE_MEMORY};
static const uint8 *program_bytes; /* the scripts, one behind the other */
static uint16 slots[SLOTS];
static uint16 starts;
static bool later_used; /* LATER was executed: the order of its interrupt and the call's steps is open */
static sys_event_data *results[MOST_PIDS]; /* wait result by PID */

static const uint16 events[] = {SYS_FIRST_USER_EVENT, SYS_FIRST_USER_EVENT + 1, SYS_FIRST_USER_EVENT + 8,
                                SYS_1ms_TIMER, SYS_EVENT_TERMINATION, SYS_LEFTMOTOR_SPEED, SYS_DEADLINE_MISSED, 0x99};
static const uint16 sizes[] = {0, 1, 2, 3, 9, 16, 17, SYS_SMALL_PAYLOAD, SYS_SMALL_PAYLOAD + 1, 1025};
enum { LARGEST_FIRST_BYTE = 3, LARGEST_PAYLOAD = SYS_SMALL_PAYLOAD + 1 };
/* 0, 1, 2 ...: payloads that no interrupt changes. Payloads above SYS_MAXIMUM_PAYLOAD are refused unread. */
static uint8 counting[LARGEST_PAYLOAD + LARGEST_FIRST_BYTE];

static sys_mutex mutexes[] = {SYS_MUTEX(0), SYS_MUTEX(2), SYS_MUTEX(3)};
static sys_cleanup cleanups[4];
static sys_quota quotas[2];
static sys_notification notifications[2];
static sys_semaphore semaphores[] = {SYS_SEMAPHORE(0), SYS_SEMAPHORE(65534)};
static sys_timer timers[2];

/* ---- Schedulers ------------------------------------------------------------------------------------------------- */

static sys_pcb *lowest_pid(sys_pcb *first)
{
    sys_pcb *best = first;
    for (sys_pcb *p = Sys_Next_Ready(first); p != first; p = Sys_Next_Ready(p)) {
        if (Sys_Pid_Of(p) < Sys_Pid_Of(best)) {
            best = p;
        }
    }
    return best;
}

static sys_pcb *lowest_priority(sys_pcb *first)
{
    sys_pcb *best = first;
    for (sys_pcb *p = Sys_Next_Ready(first); p != first; p = Sys_Next_Ready(p)) {
        if (Sys_Priority_Of(p) < Sys_Priority_Of(best)) {
            best = p;
        }
    }
    return best;
}

static const sys_scheduler by_pid = {lowest_pid, true}, by_low_priority = {lowest_priority, false}, no_pick = {NULL, true};
static const sys_scheduler *const schedulers[] = {&sys_round_robin, &sys_woken_first, &sys_fixed_priority,
                                                  &sys_earliest_deadline, &by_pid, &by_low_priority, &no_pick, NULL};

/* ---- Records ---------------------------------------------------------------------------------------------------- */

typedef struct {
    uint8 kind, number, index;
    sys_event_data *data; /* argument of a handler or condition */
} place;

static void put(const place *at, uint8 code, uint16 result, uint16 extra)
{
    /* The call unlocks the slice: a switch that was requested occurs here, as may an interrupt, before the record is made. */
    (void)Sys_IsEventRegistered(NOTHING);
    uint16 heap = at->kind == KIND_ISR ? 0 : Sys_Get_Statistics()->heap_used;
    record r = {at->number, at->kind, at->index, code, Sys_Get_ProcessID(), result, Sys_Get_LastError(), heap, clock_now(),
                extra};
    machine_record(&r);
}

static uint16 digest(const sys_event_data *data)
{
    uint16 sum = data->size;
    for (uint16 i = 0; i < data->size; i++) {
        sum = (uint16)(sum * 31u + ((const uint8 *)data->payload)[i]);
    }
    return sum;
}

/* ---- Scripts ---------------------------------------------------------------------------------------------------- */

static void run_script(place *at);

static script script_of(uint8 number)
{
    const uint8 *s = program_bytes;
    while (number-- != 0) {
        s += 2 + *s * sizeof(operation);
    }
    return (script){s[0], s[1], (const operation *)(const void *)(s + 2)};
}

static bool run(uint8 kind, uint8 first, uint8 number, uint16 result, sys_event_data *data)
{
    place at = {kind, (uint8)(first + number), 0, data};
    uint8 answer = script_of(at.number).answer;
    put(&at, ENTRY, result, data != NULL ? digest(data) : 0);
    run_script(&at);
    return answer == 2 && data != NULL ? data->value & 1u : answer != 0;
}

static void thread(void *number)
{
    (void)run(KIND_THREAD, THREADS, (uint8)(uintptr_t)number, 0, NULL);
}

#define PLAIN(n) static void thread_##n(void) { thread((void *)(uintptr_t)(n)); }
PLAIN(0) PLAIN(1) PLAIN(2) PLAIN(3)
static const sys_function plain[] = {thread_0, thread_1, thread_2, thread_3};

#define HANDLER(n)                                                                        \
    static bool handler_##n(uint16 pid, uint16 event, sys_event_data *data)               \
    {                                                                                     \
        return run(KIND_HANDLER, HANDLERS, n, (uint16)(pid * 256u + event), data);        \
    }
HANDLER(0) HANDLER(1) HANDLER(2) HANDLER(3)
static const sys_handler handlers[] = {handler_0, handler_1, handler_2, handler_3, NULL};

#define CONDITION(n)                                                                      \
    static bool condition_##n(sys_event_data *data)                                       \
    {                                                                                     \
        return run(KIND_CONDITION, CONDITIONS, n, 0, data);                               \
    }
CONDITION(0) CONDITION(1) CONDITION(2)
static const sys_condition conditions[] = {NULL, condition_0, condition_1, condition_2};

static void cleanup(void *number)
{
    (void)run(KIND_CLEANUP, CLEANUPS, (uint8)(uintptr_t)number, 0, NULL);
}

#define ISR(name, n) static void name(void) { (void)run(KIND_ISR, ISRS, n, 0, NULL); }
ISR(isr_0, 0) ISR(isr_1, 1) ISR(isr_later, 2)

/* ---- Operands --------------------------------------------------------------------------------------------------- */

static const sys_process_config service_0 = {thread, (void *)0, 0, 1, 0, 0, 0};
static const sys_process_config service_1 = {thread, (void *)1, 0, 2, 0, 0, 0};
static const sys_process_config service_bad = {thread, (void *)1, 10, 2, 0, 0, 0};
static sys_service services[] = {{.config = &service_0, .limit_ms = 3, .restarts = 2},
                                 {.config = &service_1, .limit_ms = 0, .restarts = SYS_ALWAYS},
                                 {.config = &service_bad, .limit_ms = 3, .restarts = 1}};

static uint16 pid_of(uint8 operand)
{
    switch (operand) {
    case 4: return 0;
    case 5: return Sys_Get_ProcessID();
    case 6: return 0xFFFF;
    case 7: return 77;
    case 8: return services[0].pid;
    case 9: return services[1].pid;
    default: return slots[operand % SLOTS];
    }
}

static sys_process_config configured(uint8 number, uint8 what)
{
    sys_process_config c = {thread, (void *)(uintptr_t)number, 0, what & 3u, 0, 0, 0};
    switch (what >> 2) {
    case 1: c.flags = SYS_PERIODIC; c.period_ms = 3; c.deadline_ms = 2; break;
    case 2: c.flags = SYS_PERIODIC; c.period_ms = 1; c.deadline_ms = 1; break;
    case 3: c.flags = SYS_PERIODIC; c.period_ms = 8; c.deadline_ms = 4; break;
    case 4: c.stack = SYS_DEFAULT_STACK + 2 * HEAP_STEP; break;
    case 5: c.flags = SYS_PERIODIC; c.period_ms = 2; c.deadline_ms = 3; break;
    case 6: c.flags = 0x0100; break;
    case 7: c.entry = NULL; break;
    case 8: c.stack = SYS_MINIMUM_STACK - HEAP_STEP; break;
    default: break;
    }
    return c;
}

static uint16 send(uint16 event, uint8 size, uint8 first)
{
    uint16 bytes = sizes[size];
    return Sys_Send_Event(event, bytes == 9 && first == 0 ? NULL : counting + first, bytes);
}

/* Where the running script keeps event data: a thread its wait result, a handler or condition its argument. */
static sys_event_data **result_of(place *at)
{
    return at->kind <= KIND_THREAD ? &results[Sys_Get_ProcessID() % MOST_PIDS] : &at->data;
}

static uint16 wait(place *at, const operation *o, uint16 *extra)
{
    uint16 event = events[o->a];
    sys_event_data *data = o->code == WAIT_EVENT       ? Sys_Wait_for_Event(event)
                           : o->code == WAIT_CONDITION ? Sys_Wait_for_Condition(event, conditions[o->b])
                                                       : Sys_Wait_for_ConditionTimeout(event, conditions[o->b], o->c);
    if (data == NULL && Sys_Get_LastError() == SYS_ERROR_CONTEXT) { /* refused: the thread still owns the last result */
        return NOTHING;
    }
    *result_of(at) = data;
    *extra = data != NULL ? digest(data) : 0;
    return data != NULL ? data->value : NOTHING;
}

#include "shared_events.inc"

/* ---- Operations ------------------------------------------------------------------------------------------------- */

static uint16 start(const operation *o)
{
    sys_process_config c = configured(o->b, o->c);
    if (starts == MOST_STARTS) {
        return SKIPPED;
    }
    starts++;
    uint16 pid = o->code == START_PROCESS ? Sys_Start_Process(plain[o->b])
                 : o->code == START_WITH  ? Sys_Start_ProcessWith(&c) : Sys_Start_Joinable(&c);
    if (pid != 0) {
        slots[o->a] = pid;
    }
    return pid;
}

static uint16 statistic(uint8 member)
{
    const sys_statistics *s = Sys_Get_Statistics();
    return member == 0 ? (later_used ? 0 : s->heap_peak) : member == 1 ? s->events_lost : member == 2 ? s->refused : s->deadlines_missed;
}

/* Before a wait that frees the thread's wait result, if it blocks. */
static void forget_result(place *at)
{
    if (at->kind <= KIND_THREAD) {
        *result_of(at) = NULL;
    }
}

static uint16 wait_notification(const operation *o, uint16 *extra)
{
    uint16 taken = Sys_Wait_for_Notification(&notifications[o->a], o->b, o->c);
    *extra = notifications[o->a].value;
    return taken;
}

static uint16 execute(place *at, const operation *o, uint16 *extra)
{
    switch (o->code) {
    case START_KERNEL: machine_start(); return 0;
    case RUN_SYSTEM_THREAD: Sys_Run_SystemThread(); return 0;
    case START_PROCESS:
    case START_WITH:
    case START_JOINABLE: return start(o);
    case KILL: return Sys_Kill_Process(pid_of(o->a));
    case YIELD: Sys_Yield(); return 0;
    case SLEEP: Sys_Sleep(o->a); return 0;
    case WAIT_FOR_PERIOD: return Sys_Wait_for_Period();
    case START_SECTION: Sys_Start_CriticalSection(); return 0;
    case END_SECTION: Sys_End_CriticalSection(); return 0;
    case PROCESS_STATE: return (uint16)Sys_Get_ProcessState(pid_of(o->a));
    case UNUSED_STACK: return Sys_Get_UnusedStack(pid_of(o->a));
    case UNUSED_KERNEL_STACK: return Sys_Get_UnusedKernelStack();
    case SET_SCHEDULER: return Sys_Set_Scheduler(schedulers[o->a]);
    case REGISTER: return Sys_Register_Event(events[o->a]);
    case UNREGISTER: return Sys_Unregister_Event(events[o->a]);
    case IS_REGISTERED: return Sys_IsEventRegistered(events[o->a]);
    case SUBSCRIBE:
        return Sys_Subscribe_to_Event(events[o->a], pid_of(o->b), handlers[o->c % 8], conditions[o->c / 8]);
    case UNSUBSCRIBE: return Sys_Unsubscribe_from_Event(events[o->a], pid_of(o->b));
    case UNSUBSCRIBE_HANDLER: return Sys_Unsubscribe_Handler(events[o->a], pid_of(o->b), handlers[o->c]);
    case SEND: return send(events[o->a], o->b, o->c);
    case SEND_INT: return Sys_Send_IntEvent(events[o->a], o->b);
    case WAIT_EVENT:
    case WAIT_CONDITION:
    case WAIT_TIMEOUT: return wait(at, o, extra);
    case READ:
        *extra = *result_of(at) != NULL ? digest(*result_of(at)) : 0;
        return *result_of(at) != NULL ? (*result_of(at))->value : NOTHING;
    case CLEAR: Sys_Clear_EventData(result_of(at)); return *result_of(at) == NULL;
    case LOST: return Sys_Get_LostEvents(events[o->a]);
    case STATISTICS: return statistic(o->a);
    case MOTOR_SPEEDS: *extra = (uint16)Sys_Get_MotorSpeed_Right(); return (uint16)Sys_Get_MotorSpeed_Left();
    case LOCK: return Sys_Lock_Mutex(&mutexes[o->a]);
    case LOCK_TIMEOUT: return Sys_Lock_MutexTimeout(&mutexes[o->a], o->b);
    case UNLOCK: return Sys_Unlock_Mutex(&mutexes[o->a]);
    case JOIN: return Sys_Join(pid_of(o->a));
    case JOIN_TIMEOUT: return Sys_JoinTimeout(pid_of(o->a), o->b);
    case NOTIFY: Sys_Notify(&notifications[o->a], o->b); return 0;
    case NOTIFY_VALUE: Sys_Notify_Value(&notifications[o->a], o->b, o->c); return 0;
    case WAIT_NOTIFICATION: forget_result(at); return wait_notification(o, extra);
    case SIGNAL: return Sys_Signal_Semaphore(&semaphores[o->a]);
    case WAIT_SEMAPHORE: forget_result(at); return Sys_Wait_for_Semaphore(&semaphores[o->a]);
    case WAIT_SEMAPHORE_TIMEOUT: forget_result(at); return Sys_Wait_for_SemaphoreTimeout(&semaphores[o->a], o->b);
    case START_TIMER: return Sys_Start_Timer(&timers[o->a], events[o->b], o->c, o->c & 15u, o->c >> 4);
    case STOP_TIMER: return Sys_Stop_Timer(&timers[o->a]);
    case PUSH:
        return Sys_Push_Cleanup(o->a == 4 ? NULL : &cleanups[o->a], o->b == 3 ? NULL : cleanup, (void *)(uintptr_t)o->b);
    case POP: return Sys_Pop_Cleanup(o->a);
    case LIMIT: return Sys_Limit_Event(&quotas[o->a], events[o->b], o->c);
    case KEEP: return Sys_Keep_Latest(&quotas[o->a], events[o->b]);
    case START_SERVICE: return Sys_Start_Service(&services[o->a]);
    case FEED: return Sys_Feed_Watchdog();
    case TICK: machine_tick(); return 0;
    case SLICE: machine_slice(); return 0;
    case SHARE: return Sys_Share_Event(events[o->a], o->b);
    case REMOTE_STATISTICS: return remote_statistic(o->a);
    case ARRIVE: frame_arrives(events[o->a], (uint8)(o->b + 1u), o->c); return 0;
    case LATER:
        if (later_used) {
            return SKIPPED;
        }
        later_used = true;
        machine_interrupt_at_unlock(o->a, isr_later);
        return 0;
    case SYSTEM_TIME: return (uint16)Sys_Get_SystemTime();
    case INTERRUPT: machine_interrupt(o->a ? isr_1 : isr_0); return 0;
    case FAIL: machine_fail(o->a, o->b); return 0;
    default: return SKIPPED;
    }
}

static void run_script(place *at)
{
    const script s = script_of(at->number);
    for (; at->index < s.length; at->index++) {
        const operation *o = &s.operations[at->index];
        uint16 extra = 0, result = execute(at, o, &extra);
        put(at, o->code, result, extra);
    }
    put(at, END, 0, 0);
}

void interpreter_load(const uint8 *program)
{
    program_bytes = program;
}

void interpreter_main(void)
{
    place at = {KIND_MAIN, MAIN, 0, NULL};
    for (uint16 i = 0; i < sizeof counting; i++) {
        counting[i] = (uint8)i;
    }
    Sys_Init_Kernel();
    start_link();
    run_script(&at);
    for (;;) {
        Sys_End_CriticalSection();
        Sys_Sleep(60000);
    }
}

/* ---- Final state ------------------------------------------------------------------------------------------------ */

void interpreter_final_state(void)
{
    place at = {KIND_FINAL, 0, 0, NULL};
    const sys_pcb *first = os_ring;
    for (const sys_pcb *p = first != NULL ? first->next : NULL; p != NULL; p = p != first ? p->next : NULL) {
        put(&at, 0, p->pid, p->priority);
    }
    for (const sys_pcb *p = os_blocked; p != NULL; p = p->next) {
        put(&at, 1, p->pid, p->status & OS_STATE);
    }
    for (uint8 i = 0; i < 8; i++) {
        put(&at, 2, Sys_IsEventRegistered(events[i]), Sys_Get_LostEvents(events[i]));
    }
    for (uint8 i = 0; i < 3; i++) {
        put(&at, 3, mutexes[i].owner != NULL ? Sys_Pid_Of(mutexes[i].owner) : 0xFFFF, mutexes[i].waiters != NULL);
        put(&at, 4, services[i].pid, (uint16)(services[i].bitten * 256u + services[i].restarts));
    }
    for (uint8 i = 0; i < 4; i++) {
        put(&at, 5, statistic(i), i < 2 ? quotas[i].dropped : 0);
        put(&at, 7, i < 2 ? notifications[i].bits : semaphores[i - 2].count, 0);
    }
    put(&at, 6, (uint16)Sys_Get_MotorSpeed_Left(), (uint16)Sys_Get_MotorSpeed_Right());
}
