/* SPDX-License-Identifier: MIT */
/* Private to the kernel, its ports and its schedulers.
 *
 * Who may touch what:
 *   slice locked     ring, blocked list, events, subscriptions, holes in the heap   (threads and kernel stack)
 *   devices locked   the heap's reserve, message queue, os_pending, alarm            (ISRs as well)
 * ISRs walk events, subscriptions and the blocked list without a lock: links are changed by single stores (HAL_STORE), in
 * an order (hal_barrier) that leaves every list well-formed at each instruction. The ring is closed to ISRs.
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

struct event { /* C of the memory equation: 6 B */
    uint16 id;
    event *next;
    subscription *subscribers;
};

struct subscription { /* D: 8 B */
    subscription *next;
    sys_handler handler;
    sys_condition condition; /* NULL = always */
    uint16 pid;
};

/* E: 6 B in front of the payload. While queued it is a list element, once delivered the data its readers see. */
union message {
    struct {
        message *next;
        event *event; /* NULL: unregistered meanwhile */
        uint16 size;
    } queued;
    sys_event_data data;
};

/* B: 18 B above the thread's stack. The port knows the offsets of sp, limit and status. A stack overflow spills into
 * the first 8 bytes at most (port/dspic30f/README.md); what is needed to bury the thread comes after them. */
struct sys_pcb {
    void *sp;
    hal_limit limit;
    union {
        event *awaited; /* while blocked: NULL if it waits for time only */
        uint16 spent;   /* while ready: of the slice in which it was preempted, in the port's units */
    } on;
    union {
        uint16 wake;          /* while blocked with OS_TIMED: low word of the system time */
        volatile uint8 error; /* while ready: the thread's last error */
    } own;
    uint8 status;   /* OS_* bits */
    uint8 priority;
    uint8 *block; /* start of the heap block; NULL for the system thread */
    union {
        sys_condition condition; /* while blocked on an event */
        message *result;         /* otherwise: uncleared wait result */
    } wait;
    sys_pcb *next; /* ring of ready threads, or blocked list */
    uint16 pid;
};

enum {
    OS_STATE = 0x03, /* SYS_NEW..SYS_ZOMBIE; OS_OFF_RING is set in the last two */
    OS_OFF_RING = 0x02,
    OS_TIMED = 0x04, /* while blocked */
    OS_WOKEN = 0x04, /* while ready: it has not run since; for sys_woken_first, which clears it */
    OS_MISSED = 0x20, /* this period's miss is reported */
    OS_DRIVES = 0x40, /* it uses a bus (io/bus.h) */
    OS_JOINABLE = 0x80 /* its control block stays until somebody has waited for its end (option/join.c) */
    /* 0x08 SYS_PERIODIC, 0x10 SYS_DSP */
};

/* In front of the stack of a SYS_PERIODIC thread. Times are low words of the system time. */
typedef struct {
    uint16 period, deadline, release, due;
} periodic;

static inline periodic *process_periodic(const sys_pcb *process) /* of a SYS_PERIODIC thread */
{
    return (periodic *)(void *)process->block;
}

/* os_pending: why the next thread of the ring cannot simply run. The low byte, OS_WORK, must be worked off and keeps
 * the kernel from idling; the high byte says that a scheduler chooses. One word, so that a slice end tests it once. */
enum { OS_MESSAGES = 0x01, OS_ALARM = 0x02, OS_WORK = 0xFF, OS_CHOICE = 0x100 };

extern volatile uint16 os_pending;
#define OS_HAS_WORK (*(const volatile uint8 *)&os_pending != 0) /* the low byte, which comes first */
extern sys_pcb *os_running;   /* &os_system while idle */
extern sys_pcb os_system;     /* PID 0 */
extern sys_pcb *os_ring;      /* ring member before the running one (or before the next, if it blocked); NULL = empty */
extern sys_pcb *os_blocked;   /* in order of blocking */
extern volatile uint16 critical_depth; /* of the running thread; while os_in_kernel, of the handler that runs */
extern bool os_eager;         /* what becomes due preempts the running thread */
extern volatile bool os_in_kernel; /* handlers, conditions, wake-ups and schedulers are at work on the kernel stack */
extern sys_statistics os_statistics;
extern HAL_ZEROS sys_process_config os_plain; /* all defaults */

/* memory.c: one array, so that the kernel stack lies below the heap and with it below every thread stack */
typedef union {
    void *align;
    uint8 bytes[SYS_KERNEL_STACK + SYS_HEAP];
} os_memory_space;
extern os_memory_space os_memory;
void heap_init(void);
/* Sizes are at least three pointers. NULL: none left. */
void *heap_take(uint16 size);             /* any context */
void *heap_keep(uint16 size);             /* for what is small and stays: as low as possible; not in an ISR */
void heap_give(void *block, uint16 size); /* the size it was taken with; not in an ISR */
void heap_give_later(void *block, uint16 size); /* quick for one piece behind the other; to be had after heap_settle() */
void heap_settle(void);                         /* and ISRs find some room again, if there is any */
void heap_note_use(void);

/* stack.c */
void stack_paint(void *begin, const void *end); /* whole words */
bool kernel_stack_is_intact(void); /* its last byte was never written; asked where the CPU does not trap */

/* What an application uses of option/ puts itself here; NULL otherwise. Chains: who comes later calls who was there. */
typedef bool (*os_burial)(sys_pcb *p);
extern os_burial os_at_burial; /* slice locked; p is on no list any more. True: its block has been seen to */
extern event *(*os_at_sending)(uint16 id, const void *data, uint16 size); /* to whom a sender sends, instead of event_find() */

/* event.c */
void event_init(void);
event **event_bucket(uint16 id);           /* the first link of those that share a bucket with it; slice locked */
void event_put_first(event *e, uint16 id); /* into the bucket of id */
void event_deliver_queued(void);           /* kernel stack: all messages queued when it began */
void event_drop_subscriptions(uint16 pid);
void event_release_result(sys_pcb *process); /* it gives up its wait result; the last holder frees it */
event *event_find(uint16 id);                /* any context */
/* The link behind the last queued message; devices locked, and OS_MESSAGES follows. A device may hang a block of its own
 * there, with event NULL and its size: the kernel stack frees it with the next messages. */
extern message **queue_end;
extern message *event_queue; /* what is not yet being delivered */

/* process.c */
void process_init(void);
sys_pcb *process_find(uint16 pid);               /* any live thread; slice locked */
sys_pcb *process_next(const sys_pcb *process);   /* a walk over all live threads, NULL to NULL; slice locked */
void process_wake(sys_pcb *process, message *m); /* from the blocked list to the end of the ring; m, if it waits for one */
void process_block(event *awaited, uint16 ms);   /* the running thread, after os_enter_blocking() */
sys_pcb *process_end_running(void);              /* kernel stack: buries the running thread, picks the next */
HAL_NORETURN HAL_USED void os_thread_returned(void);

/* The link at which a walk over the blocked list stands, during which threads may be woken and killed; one at a time. */
extern sys_pcb **process_scan;

/* Most calls begin with one of these, and unless they are refused end with os_leave(): the slice is locked in between,
 * as in a critical section. */
HAL_OUTLINE sys_error os_enter(void);          /* not from ISRs */
HAL_OUTLINE sys_error os_enter_blocking(void); /* from threads only; process_block() unlocks as well */
HAL_OUTLINE bool os_leave(sys_error error);    /* true, or false and the last error */
void os_call_in_section(void (*run)(void *), void *arg); /* whatever sections it begins or ends */

/* scheduler.c: the ways into the kernel stack; all pick the next thread */
HAL_USED sys_pcb *os_yield(sys_pcb *running);     /* the running thread stays ready, others come first */
HAL_USED sys_pcb *os_slice_end(sys_pcb *running); /* the same; or it was preempted and keeps turn and rest of its slice */
HAL_USED sys_pcb *os_schedule(void);              /* it is not ready any more */
void os_preempt(void); /* if the scheduler is eager, it has something to decide as soon as the level allows; any context */

/* clock.c */
void clock_set_wake(sys_pcb *process, uint16 ms); /* process is on the blocked list; slice locked */
void clock_wake_due(void);
uint16 clock_now(void);  /* low word; any context */
HAL_USED void os_clock_tick(void); /* ISR, every 1 ms */

/* error.c */
HAL_OUTLINE bool os_fail(sys_error error); /* sets the last error of whoever calls, returns false */
sys_error os_refuse(void);     /* sets, counts and returns SYS_ERROR_CONTEXT */
void os_count(uint16 *counter); /* saturating */
void event_lost(uint16 id);

/* fault.c */
HAL_USED sys_pcb *os_overflow(void); /* kernel stack: the running thread hit its stack limit; picks the next */
enum { OS_STACK = 4 };
HAL_NORETURN HAL_USED void os_trap(uint16 cause, uint16 pc, uint16 pc_high);

#endif
