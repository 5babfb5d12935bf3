/* SPDX-License-Identifier: MIT */
/* Private interface of the kernel, its ports and its schedulers.
 *
 * Lock required for each data structure:
 *   slice locked     ring, blocked list, events, subscriptions, holes in the heap   (threads and kernel stack)
 *   devices locked   heap reserve, message queue, os_pending, alarm                  (ISRs as well)
 * ISRs walk events, subscriptions and the blocked list without a lock. Links are therefore changed by single stores
 * (HAL_STORE), in an order (hal_barrier) that keeps every list well-formed at each instruction. ISRs never use the
 * ring.
 */
#ifndef OS_KERNEL_H
#define OS_KERNEL_H

#include "hal_board.h"
#include "hal_cpu.h"
#include "openswarm.h"
#include "openswarm_scheduler.h"

typedef struct event event;
typedef struct subscription subscription;
typedef union message message;

struct event { /* term C of the memory equation: 6 B */
    uint16 id;
    event *next;
    subscription *subscribers;
};

struct subscription { /* term D: 8 B */
    subscription *next;
    sys_handler handler;
    sys_condition condition; /* NULL = always */
    uint16 pid;
};

/* Term E: 6 B in front of the payload. A list element while queued; the readers' event data once delivered. */
union message {
    struct {
        message *next;
        event *event; /* NULL: the event was unregistered after the message was sent */
        uint16 size;
    } queued;
    sys_event_data data;
};

/* Three words of a control block have one meaning while the thread is ready (on the ring) and another while it is
 * blocked (on the blocked list). The thread's state in `status` selects the member:
 *
 *   record                ready (SYS_NEW, SYS_READY)       blocked (SYS_BLOCKED)
 *   event_or_slice        spent                            awaited
 *   time_or_error         error                            wake, with OS_TIMED
 *   wait                  result                           condition; result if no event is awaited */

/* Cause of a wait, or progress within the slice. */
typedef union {
    event *awaited; /* blocked: the event, or an option's object cast to event *; NULL: thread waits for time only */
    uint16 spent;   /* ready: part of the slice used before the thread was preempted, in the port's units */
} event_or_slice;

/* Time-out of a wait, or the outcome of the thread's calls. */
typedef union {
    uint16 wake;          /* blocked with OS_TIMED: low word of the system time at which the wait ends */
    volatile uint8 error; /* ready: the thread's last error */
} time_or_error;

/* Filter of a wait, or its result. */
typedef union {
    sys_condition condition; /* blocked on an event; NULL: every message ends the wait */
    message *result;         /* otherwise: the wait result, until the thread clears it */
} condition_or_result;

/* Control block of a thread (term B): 18 B above its stack. The port depends on the offsets of sp, limit and status.
 * A stack overflow overwrites at most the first 8 bytes (port/dspic30f/README.md); the fields needed to end the thread
 * follow them. */
struct sys_pcb {
    void *sp;
    hal_limit limit;
    event_or_slice event_or_slice;
    time_or_error time_or_error;
    uint8 status;   /* OS_* bits */
    uint8 priority;
    uint8 *block; /* start of the heap block; NULL for the system thread */
    condition_or_result wait;
    sys_pcb *next; /* ring of ready threads, or blocked list */
    uint16 pid;
};

enum {
    OS_STATE = 0x03, /* SYS_NEW..SYS_ZOMBIE; OS_OFF_RING is set in the last two */
    OS_OFF_RING = 0x02,
    OS_TIMED = 0x04, /* while blocked */
    OS_WOKEN = 0x04, /* while ready: woken and not run since; read and cleared by sys_woken_first */
    OS_MISSED = 0x20, /* the deadline miss of this period is reported */
    OS_USES_BUS = 0x40, /* the thread owns a bus (io/bus.h) */
    OS_JOINABLE = 0x80 /* the control block stays after the end until a thread joins it (option/join.c) */
    /* 0x08 SYS_PERIODIC, 0x10 SYS_DSP */
};

/* Timing of a SYS_PERIODIC thread, stored in front of its stack. Times are low words of the system time. */
typedef struct {
    uint16 period, deadline, release, due;
} periodic;

static inline periodic *process_periodic(const sys_pcb *process) /* SYS_PERIODIC threads only */
{
    return (periodic *)(void *)process->block;
}

/* Bits of os_pending: why the next thread of the ring cannot run at once. The low byte, OS_WORK, is pending kernel work
 * and prevents idling; the high byte is set while a scheduler chooses. One word, so that a slice end tests it once. */
enum { OS_MESSAGES = 0x01, OS_ALARM = 0x02, OS_WATCH = 0x04, OS_POSTED = 0x08, OS_WORK = 0xFF, OS_CHOICE = 0x100 };

extern volatile uint16 os_pending;
#define OS_HAS_WORK (*(const volatile uint8 *)&os_pending != 0) /* the low byte, which comes first */
extern sys_pcb *os_running;   /* &os_system while idle */
extern sys_pcb os_system;     /* system thread, PID 0 */
extern sys_pcb *os_ring;      /* ring member before the running one (or before the next, if it blocked); NULL = empty */
extern sys_pcb *os_blocked;   /* blocked threads in order of blocking */
/* Nesting in the running thread; while os_in_kernel, in the running handler. No ISR reads or changes it. */
extern volatile uint16 critical_depth;
extern bool os_eager;         /* a wake-up or message preempts the running thread */
extern volatile bool os_in_kernel; /* a handler, condition, wake-up or scheduler runs on the kernel stack */
extern sys_statistics os_statistics;
extern HAL_ZEROS sys_process_config os_plain; /* all defaults */

/* memory.c: one array, so that the kernel stack lies below the heap and therefore below every thread stack */
typedef union {
    void *align;
    uint8 bytes[SYS_KERNEL_STACK + SYS_HEAP];
} os_memory_space;
extern os_memory_space os_memory;
void heap_init(void);
/* Sizes are at least three pointers. NULL: out of memory. */
void *heap_alloc(uint16 size);            /* any context */
void *heap_alloc_lasting(uint16 size);    /* small, long-lived blocks: at the lowest address; not in an ISR */
void heap_free(void *block, uint16 size); /* with the size of the allocation; not in an ISR */
void heap_free_deferred(void *block, uint16 size); /* fast for adjacent blocks; allocatable after heap_coalesce() */
void heap_coalesce(void); /* merges the blocks of heap_free_deferred() and refills the reserve of the ISRs */
void heap_update_peak(void);

/* stack.c */
void stack_paint(void *begin, const void *end); /* whole words */
bool kernel_stack_is_intact(void); /* its last byte was never written; for CPUs without a stack limit trap */

/* Hooks of option/: each belongs to one option, which sets it at its first use; else NULL. Hooks of the teardown run
 * in this order, slice locked, when p has left the ring or the blocked list. */
typedef void (*os_teardown_function)(sys_pcb *p);
extern os_teardown_function os_release_mutexes, os_release_joins, os_release_service;
extern os_teardown_function os_run_cleanups; /* calls process_free(p) when the cleanups of p have run */
extern bool (*os_free_joinable)(sys_pcb *p); /* true: the memory is freed, or kept by a zombie */
extern void (*os_watch)(void); /* kernel stack, slice level, after each tick; needs no heap */
/* Kernel stack, slice level, after OS_POSTED was set: wake threads of the blocked list. */
extern void (*os_grant_semaphores)(void), (*os_wake_notified)(void);
extern void (*os_expire_timers)(void); /* kernel stack, slice level, after an alarm; sets the next one */
extern void (*os_feed)(void); /* kernel stack, slice level, after each tick */
extern void (*os_record_fault)(uint16 fault, uint16 place, uint16 page); /* a fatal fault; everything is masked */
extern event *(*os_send_hook)(uint16 id, const void *data, uint16 size); /* a sender's event, instead of event_find() */
extern void (*os_share_hook)(uint16 id, const void *data, uint16 size); /* any context: an event that may be shared */

/* event.c */
enum { OS_DRIVERS = 0xFFFF }; /* owner of the drivers' subscriptions: the PID of no thread */
void event_init(void);
event **event_bucket(uint16 id);        /* first link of the bucket of id; slice locked */
void event_insert(event *e, uint16 id); /* at the head of the bucket of id */
void event_deliver_queued(void);        /* kernel stack: all messages queued before the call */
void event_drop_subscriptions(uint16 pid);
void event_release_result(sys_pcb *process); /* releases the wait result; the last holder frees the message */
event *event_find(uint16 id);                /* any context */
bool event_connect(uint16 id, sys_handler handler); /* subscribes a handler of a driver, which belongs to no thread */
/* Sends an event of the kernel's own; not in an ISR. A failure is counted as a lost event, but is no error of the
 * caller. */
void event_announce(uint16 id, uint16 value);
/* Link behind the last queued message; devices locked; set OS_MESSAGES after an insertion. A device may append a
 * block of its own with event NULL and its size: the kernel frees the block with the next messages. */
extern message **queue_end;
extern message *event_queue, *delivery_batch; /* messages sent since the current delivery round began; those before */

/* process.c */
void process_init(void);
/* A critical section; not in an ISR. */
HAL_OUTLINE void section_open(void);
HAL_OUTLINE void section_close(void);
void section_start(void); /* after hal_start(): enters thread level, or lets the end of main's section do so */
sys_pcb *process_find(uint16 pid);               /* any live thread; slice locked */
sys_pcb *process_next(const sys_pcb *process);   /* iterates over live threads, from NULL to NULL; slice locked */
void process_wake(sys_pcb *process, message *m); /* blocked list to the end of the ring; m: result of an event wait */
bool process_awaits(const event *object);        /* whether a blocked thread waits for it; slice locked */
void process_block(event *awaited, uint16 ms);   /* blocks the running thread; after os_enter_blocking() */
sys_pcb *process_end_running(void);              /* kernel stack: ends the running thread, picks the next */
HAL_NORETURN HAL_USED void os_thread_returned(void);
void process_free(sys_pcb *p); /* last step of the teardown */
/* Thread on whose stack cleanups of other threads run, with os_running set to the dying one; else NULL. If a cleanup
 * kills it, it ends after them. */
extern sys_pcb *os_cleanup_host;
extern bool os_cleanup_host_ends;

/* Cursor of the walk over the blocked list during which threads may be woken and killed; one walk at a time. */
extern sys_pcb **process_scan;

/* Most kernel calls begin with os_enter() or os_enter_blocking() and, unless refused, end with os_leave(). The slice is
 * locked in between, as in a critical section. */
HAL_OUTLINE sys_error os_enter(void);          /* refused in ISRs */
HAL_OUTLINE sys_error os_enter_blocking(void); /* refused outside threads; process_block() also unlocks */
HAL_OUTLINE bool os_leave(sys_error error);    /* returns true, or false and sets the last error */
void os_call_in_section(void (*run)(void *), void *arg); /* run cannot end the section, whatever it starts or ends */

/* scheduler.c: entry points on the kernel stack; all return the next thread */
HAL_USED sys_pcb *os_yield(sys_pcb *running);     /* running stays ready and moves to the end of the ring */
HAL_USED sys_pcb *os_slice_end(sys_pcb *running); /* as os_yield(); a preempted thread keeps its turn and its rest */
HAL_USED sys_pcb *os_schedule(void);              /* the running thread is no longer ready */
void os_preempt(void); /* requests a decision of an eager scheduler as soon as the level allows; any context */

/* clock.c */
uint16 clock_set_alarm_in(uint16 ms); /* returns the low word of the alarm's time; slice locked */
void clock_set_alarm(uint16 moment);  /* if it is earlier than the alarm in force */
void clock_set_wake(sys_pcb *process, uint16 ms); /* starts the time-out of a blocked process; slice locked */
void clock_wake_due(void);
uint16 clock_now(void);  /* low word; any context */
HAL_USED void os_clock_tick(void); /* ISR, every 1 ms */

/* error.c */
extern struct os_errors {
    volatile uint8 handlers, isrs; /* last error of all handlers, and of all ISRs */
} os_errors;
HAL_OUTLINE bool os_fail(sys_error error); /* sets the caller's last error and returns false */
sys_error os_refuse(void);     /* sets, counts and returns SYS_ERROR_CONTEXT */
void os_count(uint16 *counter); /* saturating */
void event_lost(uint16 id);

/* fault.c */
/* SYS_DROP_THREAD only. Kernel stack: ends the thread that hit its stack limit; picks the next. */
HAL_USED sys_pcb *os_overflow(void);
enum { OS_STACK = 4 };
HAL_NORETURN HAL_USED void os_trap(uint16 cause, uint16 pc, uint16 pc_high);

#endif
