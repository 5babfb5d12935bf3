/* SPDX-License-Identifier: MIT */
/* Entry points on the kernel stack, and the schedulers. */
#include "kernel.h"

LINKS_IN_RAM();

volatile uint16 os_pending;
bool os_eager;
volatile bool os_in_kernel;
PRIVATE_VALUE(os_in_kernel, 0);

void (*os_watch)(void);
void (*os_feed)(void);
void (*os_grant_semaphores)(void);
void (*os_wake_notified)(void);
void (*os_expire_timers)(void);
static sys_pick pick_thread; /* NULL = round robin */

/* ---- Dispatch: kernel stack, slice level ------------------------------------------------------------------------ */

/* Delivers messages and expires time-outs. */
static HAL_OUTLINE void work(void)
{
    event_deliver_queued();
    if (os_pending & OS_ALARM) {
        HAL_CLEAR_BIT(os_pending, 1);
        clock_wake_due();
        if (os_expire_timers != NULL) {
            os_expire_timers();
            event_deliver_queued(); /* the events of timers do not wait for the next switch */
        }
    }
    critical_depth = 0; /* ends a section that a handler left open */
    if ((os_watch != NULL || os_feed != NULL) && (os_pending & OS_WATCH)) {
        HAL_CLEAR_BIT(os_pending, 2);
        if (os_watch != NULL) {
            os_watch();
        }
        if (os_feed != NULL) {
            os_feed();
        }
    }
    if ((os_grant_semaphores != NULL || os_wake_notified != NULL) && (os_pending & OS_POSTED)) {
        HAL_CLEAR_BIT(os_pending, 3);
        if (os_grant_semaphores != NULL) {
            os_grant_semaphores();
        }
        if (os_wake_notified != NULL) {
            os_wake_notified();
        }
    }
#if !HAL_STACK_TRAPS
    if (!kernel_stack_is_intact()) {
        os_trap(OS_STACK, 0, 0);
    }
#endif
}

static HAL_INLINE sys_pcb *dispatch(sys_pcb *next, uint16 spent)
{
    HAL_STORE(os_running, next);
    hal_slice_restart(spent); /* after the handlers: the whole slice belongs to next */
    return next;
}

BOUNDS_AT("if (os_ring != NULL)", loop i); /* i times idle; 0: a thread is ready */
BOUNDS_AT("pick(os_ring->next)", calls (sys_pick, -os_slice_end, -os_yield));
BOUNDS_AT("while (os_ring->next != next)", loop n);
sys_pcb *os_schedule(void)
{
    hal_guard_kernel_stack();
    os_in_kernel = true;
    for (;;) {
        hal_slice_unforce(); /* a request from here on enters the kernel again */
        if (OS_HAS_WORK) {
            work();
        }
        if (os_ring != NULL) {
            break;
        }
        HAL_STORE(os_running, &os_system);
        hal_idle(&os_pending);
    }
    sys_pick pick = HAL_LOAD(pick_thread);
    if (pick != NULL) {
        const sys_pcb *next = pick(os_ring->next);
        while (os_ring->next != next) {
            os_ring = os_ring->next;
        }
    }
    os_in_kernel = false;
    sys_pcb *next = os_ring->next;
    uint16 spent = next->event_or_slice.spent;
    next->event_or_slice.spent = 0;
    return dispatch(next, spent);
}

sys_pcb *os_yield(sys_pcb *running)
{
    os_ring = running; /* running was os_ring->next: advances the ring by one */
    if (HAL_LIKELY(os_pending == 0)) {
        return dispatch(running->next, 0);
    }
    return os_schedule();
}

sys_pcb *os_slice_end(sys_pcb *running)
{
    if (HAL_LIKELY(os_pending == 0)) {
        os_ring = running;
        return dispatch(running->next, 0);
    }
    uint16 spent = hal_slice_spent();
    if (hal_slice_is_over()) { /* re-check after reading `spent`: the slice may have expired in between */
        return os_yield(running);
    }
    running->event_or_slice.spent = spent; /* os_ring is unchanged: running continues once no better thread is ready */
    return os_schedule();
}

/* Messages sent by handlers wait for the next tick: a handler that always resends must not starve the threads. */
void os_preempt(void)
{
    if (os_eager && (!os_in_kernel || hal_in_isr())) {
        hal_slice_force();
    }
}

HAL_OUTLINE void Sys_Yield(void) /* `emu cycles` counts from its entry, at -O2 too */
{
    if (HAL_LIKELY(hal_in_thread())) {
        hal_yield();
    } else {
        (void)os_refuse();
    }
}

bool Sys_Set_Scheduler(const sys_scheduler *scheduler)
{
    if (scheduler == NULL) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    hal_lock_state lock = hal_lock_devices();
    pick_thread = scheduler->pick;
    os_eager = scheduler->eager;
    os_pending |= OS_CHOICE;
    if (pick_thread == NULL) { /* round robin chooses no thread within a slice */
        os_pending &= (uint16)~OS_CHOICE;
        os_eager = false;
        hal_slice_unforce();
    }
    hal_unlock(lock);
    return true;
}

/* ---- Schedulers ------------------------------------------------------------------------------------------------- */

sys_pcb *Sys_Next_Ready(const sys_pcb *process)
{
    return process->next;
}

uint16 Sys_Pid_Of(const sys_pcb *process)
{
    return process->pid;
}

uint8 Sys_Priority_Of(const sys_pcb *process)
{
    return process->priority;
}

BOUNDS_AT("for (", loop n);
static sys_pcb *highest_priority(sys_pcb *first)
{
    sys_pcb *best = first;
    for (sys_pcb *p = first->next; p != first; p = p->next) {
        if (p->priority > best->priority) {
            best = p;
        }
    }
    return best;
}

static void report_miss(sys_pcb *p)
{
    p->status |= OS_MISSED;
    os_count(&os_statistics.deadlines_missed);
    event_announce(SYS_DEADLINE_MISSED, p->pid);
}

/* Picks the job on time with the earliest deadline. If there is none, late jobs and threads without a period share the
 * CPU by round robin, so that a late job cannot starve them. */
BOUNDS_AT("} while (p != first)", loop n);
static sys_pcb *earliest_deadline(sys_pcb *first)
{
    uint16 now = clock_now();
    sint16 least = INT16_MAX;
    sys_pcb *best = first, *p = first;
    do {
        if ((p->status & (SYS_PERIODIC | OS_MISSED)) == SYS_PERIODIC) {
            sint16 left = (sint16)(process_periodic(p)->due - now);
            if (left < 0) {
                report_miss(p);
            } else if (left < least) {
                least = left;
                best = p;
                hal_barrier(); /* makes the compiler emit a branch, which is shorter than two conditional moves */
            }
        }
        p = p->next;
    } while (p != first);
    return best;
}

bool Sys_Wait_for_Period(void)
{
    sys_pcb *self = os_running;
    periodic *timing = process_periodic(self);
    if (os_enter_blocking() != SYS_OK) {
        return false;
    }
    if (!(self->status & SYS_PERIODIC)) {
        return os_leave(SYS_ERROR_PROCESS);
    }
    uint16 now = clock_now();
    bool met = (sint16)(timing->due - now) >= 0;
    if (!met && !(self->status & OS_MISSED)) {
        report_miss(self);
    }
    self->status &= (uint8)~OS_MISSED;
    timing->release = (uint16)(timing->release + timing->period);
    timing->due = (uint16)(timing->release + timing->deadline);
    uint16 ahead = (uint16)(timing->release - now);
    if ((sint16)ahead > 0) {
        process_block(NULL, ahead);
    } else {
        (void)os_leave(SYS_OK); /* overrun: the next job is already released */
        Sys_Yield();
    }
    return met;
}

const sys_scheduler sys_round_robin = {NULL, false};
const sys_scheduler sys_fixed_priority = {highest_priority, true};
const sys_scheduler sys_earliest_deadline = {earliest_deadline, true};
