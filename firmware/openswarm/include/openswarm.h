/* SPDX-License-Identifier: MIT */
/* OpenSwarm: public interface of the kernel.
 *
 * Threads are preempted every 10 ms. Event handlers run to completion between two threads, on the kernel stack, and
 * are charged to no thread. Interrupt service routines (ISRs) only record and send.
 *
 * Each function below carries one contract line:
 *     callers | blocks? | worst-case Tcy on the dsPIC30F | stack bytes | error codes (Sys_Get_LastError)
 * Callers: M = main before Sys_Start_Kernel, T = thread, H = event handler or condition, I = ISR of priority 4. n
 * threads, w other threads that wait, e other threads whose time-out has expired and that do not run yet, m events,
 * b newer events in the same bucket (identifier modulo 8), s subscriptions of one event, q queued messages, d payload
 * bytes; g cycles free a block of memory: 60-150, at most 1,200 in a fragmented heap.
 *
 * Cycles count from the first instruction of a call to the instruction behind the call, without interrupts. Those of a
 * call that blocks are the caller's own, under round robin: from the call until the next thread is resumed, and from
 * the moment the caller is resumed to its return. The wait does not count, nor do the handlers, conditions and wake-ups
 * of the switch. Tests compare every number with `python -m toolchain bounds` or with runs on the emulator. Stack is
 * that of `toolchain bounds` with the return address; a switch adds its frame (port/dspic30f/README.md). Calls that may
 * block or yield are refused before Sys_Start_Kernel. A call from a context that is not listed is refused: it returns
 * failure, sets SYS_ERROR_CONTEXT and increments sys_statistics.refused.
 */
#ifndef OPENSWARM_H
#define OPENSWARM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "openswarm_config.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef uint8_t uint8;
typedef uint16_t uint16;
typedef uint32_t uint32;
typedef int8_t sint8;
typedef int16_t sint16;
typedef int32_t sint32;

/* Bit 2 is red, bit 1 green, bit 0 blue. */
typedef enum { BLACK, BLUE, GREEN, CYAN, RED, MAGENTA, YELLOW, WHITE } sys_colour;

/* Data of an event as received by a handler, a condition or a wait. Shared between its readers: do not write to it. */
typedef struct {
    uint16 value;        /* the first min(size, 2) payload bytes, zero-extended */
    uint16 size;         /* payload bytes */
    const void *payload; /* word-aligned copy of what was sent; valid until cleared or until the handler returns */
} sys_event_data;

typedef void (*sys_function)(void);
typedef bool (*sys_handler)(uint16 pid, uint16 event, sys_event_data *data); /* false: unsubscribe this handler */
typedef bool (*sys_condition)(sys_event_data *data); /* once per event and waiter, on the kernel stack; must not block */

/* Cause of the last failure of a call. */
typedef enum {
    SYS_OK,
    SYS_ERROR_CONTEXT,  /* the call is not allowed from here */
    SYS_ERROR_MEMORY,   /* the heap is exhausted */
    SYS_ERROR_EVENT,    /* the event is not registered */
    SYS_ERROR_PROCESS,  /* no thread has this PID, or it may not be killed */
    SYS_ERROR_ARGUMENT, /* a value out of its documented range */
    SYS_ERROR_BUSY      /* a bounded buffer is full; retry after the device's ready event */
} sys_error;

/* Events registered by the system. Values 1-7 are the published ones; payloads in brackets. */
enum {
    SYS_EVENT_TERMINATION = 0x01,   /* [uint16 pid] a thread has ended: returned, killed, or dropped (SYS_ON_OVERFLOW) */
    SYS_LEFTMOTOR_SPEED = 0x02,     /* [sint16 mm/s] request to the motor driver, from any sender */
    SYS_RIGHTMOTOR_SPEED = 0x03,    /* [sint16 mm/s] */
    SYS_IO_1PXSENSOR = 0x04,        /* [sys_colour] from the camera */
    SYS_IO_REMOTECONTROL = 0x05,    /* [uint8 RC-5 command] */
    SYS_SEND_UART1 = 0x06,          /* [bytes] request to send one message, whole or not at all; from any sender */
    SYS_1ms_TIMER = 0x07,           /* [uint16, low word of the system time] */
    SYS_IO_SELECTOR = 0x08,         /* [uint8 0-15] on change */
    SYS_UART1_RECEIVED = 0x09,      /* [bytes] one chunk or frame */
    SYS_UART1_READY = 0x0A,         /* [uint16 free bytes: SYS_UART_TX] queue empty after a call refused as BUSY */
    SYS_SEND_UART2 = 0x0B,
    SYS_UART2_RECEIVED = 0x0C,
    SYS_UART2_READY = 0x0D,
    SYS_DEADLINE_MISSED = 0x0E,     /* [uint16 pid] from the earliest-deadline-first scheduler, if registered */
    SYS_FIRST_USER_EVENT = 0x40
};

/* ---- Start-up ----------------------------------------------------------------------------------------------- */

/* M | no | - | 60 | MEMORY.  Initialises kernel, board and devices; the caller becomes PID 0. Interrupts stay
 * disabled. */
void Sys_Init_Kernel(void);
/* M | no | - | 40 | none.  Enables clock, slices and devices. The caller continues as the system thread, in its
 * critical section if one is open. */
void Sys_Start_Kernel(void);
/* T (PID 0 only) | never returns | - | 12 | CONTEXT.  Retires the system thread: from now on the kernel idles
 * whenever no thread is ready, and the stack of main is no longer used. */
void Sys_Run_SystemThread(void);

/* ---- Threads ------------------------------------------------------------------------------------------------ */

typedef enum { SYS_NEW, SYS_READY, SYS_BLOCKED, SYS_ZOMBIE, SYS_RUNNING, SYS_UNKNOWN } sys_state;

enum {
    SYS_DSP = 0x0010,     /* saves accumulators, CORCON and DO loops of this thread, at a cost per switch */
    SYS_PERIODIC = 0x0008 /* has period_ms and deadline_ms */
};

typedef struct {
    void (*entry)(void *); /* the thread ends when it returns */
    void *arg;
    uint16 stack;          /* bytes, even, >= SYS_MINIMUM_STACK; 0 = SYS_DEFAULT_STACK */
    uint8 priority;        /* 0 lowest; read by the fixed-priority scheduler only */
    uint16 flags;          /* SYS_DSP, SYS_PERIODIC */
    uint16 period_ms;      /* 1..32767 with SYS_PERIODIC */
    uint16 deadline_ms;    /* relative to each release; 1..period_ms */
} sys_process_config;

/* MTH | no | 520 + 20 n, and 2 per byte beyond SYS_DEFAULT_STACK; at most 900 more while memory is short, and
 * 800 in a handler | 34 | MEMORY.  PID, or 0 = failed (PID 0 is the system thread). */
uint16 Sys_Start_Process(sys_function f);
/* MTH | no | as above | 34 | MEMORY, ARGUMENT.  The same with a configuration. */
uint16 Sys_Start_ProcessWith(const sys_process_config *config);
/* MTH | own PID: never returns | 450 + 25 m + g per subscription of its own | 54 | PROCESS.  Ends a thread with its
 * subscriptions, its wait and its uncleared wait result. */
bool Sys_Kill_Process(uint16 pid);
/* T | no | 54 to a yielded thread, 65 to a preempted one, with the call instruction | 4 | CONTEXT.  Ends the caller's
 * slice. */
void Sys_Yield(void);
/* T | yes, ms rounded up to the next 1 ms tick | 231 + 46 w + (88 + 7 w) e | 36 | CONTEXT.  0 ms = Sys_Yield. */
void Sys_Sleep(uint16 ms);
/* T with SYS_PERIODIC | until its next release | 267 + 46 w + (88 + 7 w) e; after a missed deadline another 56 and
 * those of Sys_Send_IntEvent | 60 | CONTEXT, PROCESS.  True: the deadline was met. */
bool Sys_Wait_for_Period(void);
/* MTHI | no | 18, the end 15 | 4 | none.  Nests. Until the matching End, no thread switch occurs and no handler runs;
 * the End takes a slice end that is due. Interrupts stay enabled. An open section ends with its thread, or with the
 * handlers. In an ISR neither call has an effect. */
void Sys_Start_CriticalSection(void);
void Sys_End_CriticalSection(void);
/* MTHI | no | 6 | 4 | none.  The running thread. In a handler that is the interrupted thread: use the pid argument. */
uint16 Sys_Get_ProcessID(void);
/* MTH | no | 90 + 25 n | 16 | none.  SYS_UNKNOWN: no such thread. */
sys_state Sys_Get_ProcessState(uint16 pid);
/* MTH | no | 110 + 22 n + 10 per byte | 16 | none.  Stack bytes never used so far; 0 also for an unknown PID and
 * PID 0. */
uint16 Sys_Get_UnusedStack(uint16 pid);
/* MTHI | no | 20 + 8 per byte | 4 | none.  The same for the kernel stack (handlers, ISRs and scheduler). */
uint16 Sys_Get_UnusedKernelStack(void);

/* ---- Scheduling --------------------------------------------------------------------------------------------- */

/* Chooses among the ready threads; see openswarm_scheduler.h to write one. sys_round_robin, the default and the
 * paper's: a thread that wakes is noticed at the end of the slice and enters the ring behind all ready threads. It
 * waits for up to (ready threads + 1) * 10 ms and the handlers in between, however short its Sys_Sleep was.
 * Sys_Sleep(1) beside 8 busy threads takes up to 91 ms. The other schedulers preempt: they choose at once when a
 * thread wakes or a message arrives (at the next tick if a handler sent it). The preempted thread keeps its turn and
 * the rest of its slice. sys_woken_first: round robin, but a thread that wakes runs before all threads that have not
 * waited. It waits for the handlers, and for at most a slice of each thread that woke before it. Sys_Sleep(1) beside
 * 8 busy threads takes 1 ms. Busy threads starve if woken threads use all time. Priorities have no effect.
 * sys_fixed_priority: a thread waits for threads of higher priority, and in turn for those of its own.
 * sys_earliest_deadline: runs the jobs on time by deadline. Late jobs, reported once by SYS_DEADLINE_MISSED, share
 * the remaining time with threads without a period. */
typedef struct sys_scheduler sys_scheduler;
extern const sys_scheduler sys_round_robin, sys_woken_first, sys_fixed_priority, sys_earliest_deadline;
/* MTHI | no | 28, refused 35 | 16 | ARGUMENT.  Sets the scheduler from the next thread switch on. NULL is refused. */
bool Sys_Set_Scheduler(const sys_scheduler *scheduler);

/* ---- Events ------------------------------------------------------------------------------------------------- */

/* MTH | no | 146 + 9 b; at most 600 more while memory is short | 28 | MEMORY.  True also if already registered. */
bool Sys_Register_Event(uint16 event);
/* MTH | no | 230 + 9 b + (15 + g) s + 20 n + 10 q + g | 40 | EVENT.  Ends the event's subscriptions, drops its queued
 * messages and wakes its waiters with NULL. */
bool Sys_Unregister_Event(uint16 event);
/* MTHI | no | 40 + 9 b | 14 | none. */
bool Sys_IsEventRegistered(uint16 event);
/* MTH | no | 140 + 9 b + 11 s + 18 n; at most 650 more while memory is short | 46 | EVENT, PROCESS, MEMORY, ARGUMENT.
 * Once per (event, pid, handler): subscribing again replaces the condition. condition NULL = always. Handlers run in
 * order of subscription. A handler subscribed during a delivery gets the next message first, before the handlers that
 * the current one has not reached. */
bool Sys_Subscribe_to_Event(uint16 event, uint16 pid, sys_handler handler, sys_condition condition);
/* MTH | no | 120 + 9 b + (15 + g) s | 48 | EVENT, PROCESS: it had none.  Unsubscribes all handlers of a thread. PID 0
 * is the system thread only: the drivers' handlers belong to no thread. */
bool Sys_Unsubscribe_from_Event(uint16 event, uint16 pid);
/* MTH | no | 120 + 9 b + (15 + g) s | 44 | EVENT, PROCESS: it was not subscribed.  Unsubscribes one handler. */
bool Sys_Unsubscribe_Handler(uint16 event, uint16 pid, sys_handler handler);
/* MTHI | no | 95, or 124 + 10 b; 17 + d/2 more unless d = 2; 8 per waiting thread if there is no handler; 70 without
 * listeners; at most 460 more while memory is short | 30 | EVENT, MEMORY, ARGUMENT.  Copies the payload into a
 * queued message. True also without listeners; then nothing is stored. False: nothing was queued. Payloads above
 * SYS_SMALL_PAYLOAD: not from an ISR. ISRs share the free block that was the largest when memory was last freed or a
 * thread started. */
bool Sys_Send_Event(uint16 event, const void *data, uint16 size);
/* MTHI | no | 104, or 133 + 10 b | 36 | EVENT, MEMORY.  As above. */
bool Sys_Send_IntEvent(uint16 event, uint16 value);
/* T | yes | 229 + 9 b + 7 (w + e); 17 + 22 n + g more if it frees a result | 42 | CONTEXT, EVENT.  NULL: refused, or
 * the event was unregistered. A thread owns one wait result at a time; its next wait, except sleep, frees it. */
sys_event_data *Sys_Wait_for_Event(uint16 event);
sys_event_data *Sys_Wait_for_Condition(uint16 event, sys_condition condition);
/* T | yes | as above; with a time-out 53 + 39 w + (81 + 7 w) e more | 48 | CONTEXT, EVENT.  NULL with SYS_OK also after
 * ms milliseconds. ms 0 = no time-out. */
sys_event_data *Sys_Wait_for_ConditionTimeout(uint16 event, sys_condition condition, uint16 ms);
/* T | no | 88 + 22 n + g | 36 | none.  Frees a wait result and sets *data = NULL. NULL-safe; in a handler or an ISR
 * it only sets NULL. */
void Sys_Clear_EventData(sys_event_data **data);
/* MTHI | no | 40 | 4 | none.  Messages of this event lost for lack of memory since the start; saturates at 65535. */
uint16 Sys_Get_LostEvents(uint16 event);

/* ---- Information -------------------------------------------------------------------------------------------- */

typedef struct {
    uint16 heap_used;   /* allocated heap bytes */
    uint16 heap_peak;   /* maximum of heap_used so far */
    uint16 events_lost; /* messages refused for lack of memory; saturates */
    uint16 refused;     /* calls from a context that does not permit them; saturates */
    uint16 deadlines_missed;
    uint16 overflows;   /* threads dropped after a stack overflow (SYS_ON_OVERFLOW) */
} sys_statistics;

/* MTHI | no | 14 | 8 | none. */
const sys_statistics *Sys_Get_Statistics(void);
/* MTHI | no | 9 | 4 | none.  Milliseconds since Sys_Start_Kernel, without drift; wraps after 49.7 days. */
uint32 Sys_Get_SystemTime(void);
/* MTHI | no | 18 | 8 | none.  The caller's sys_error: each thread has one; all handlers and conditions share one;
 * all ISRs share one. It stays until the next failing call; sends and restarts of the kernel itself do not change it.
 * In a thread, blocking may set it to SYS_OK. */
uint16 Sys_Get_LastError(void);
/* MTHI | no | 4 | 4 | none.  The current speed, mm/s, after the post-processor. */
sint16 Sys_Get_MotorSpeed_Left(void);
sint16 Sys_Get_MotorSpeed_Right(void);

/* ---- Assertions --------------------------------------------------------------------------------------------- */

/* Stops the motors, reports "file:line" over the board's report channel and stops the system. */
void Sys_Assertion_Failed(const char *file, uint16 line);
#define SYS_ASSERT(condition) ((condition) ? (void)0 : Sys_Assertion_Failed(__FILE__, __LINE__))

#ifdef __cplusplus
}
#endif

#endif
