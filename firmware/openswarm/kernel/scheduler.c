/* SPDX-License-Identifier: MIT */
/* The two ways into the kernel stack, and the schedulers. */
#include "kernel.h"

volatile uint16 os_pending;
bool os_eager;
volatile bool os_in_kernel;

static sys_pcb *(*pick_thread)(sys_pcb *first); /* NULL = round robin */

/* ---- Dispatch: kernel stack, slice level ------------------------------------------------------------------------ */

static void work(void)
{
    event_deliver_queued();
    HAL_STORE(critical_depth, 0); /* a section that a handler left open ends with the handlers */
    if (os_pending & OS_ALARM) {
        hal_lock_state lock = hal_lock_devices();
        os_pending &= (uint16)~OS_ALARM;
        hal_unlock(lock);
        clock_wake_due();
    }
#if !HAL_STACK_TRAPS
    if (!kernel_stack_is_intact()) {
        os_trap(OS_STACK, 0, 0);
    }
#endif
}

static HAL_INLINE sys_pcb *dispatch(sys_pcb *next)
{
    HAL_STORE(os_running, next);
    hal_slice_restart(); /* handlers are over: the whole slice belongs to next */
    return next;
}

sys_pcb *os_schedule(void)
{
    hal_guard_kernel_stack();
    os_in_kernel = true;
    if ((os_pending & OS_WORK) != 0) {
        work();
    }
    while (os_ring == NULL) {
        HAL_STORE(os_running, &os_system);
        hal_idle(&os_pending);
        work();
    }
    sys_pcb *(*pick)(sys_pcb *) = HAL_LOAD(pick_thread);
    if (pick != NULL) {
        const sys_pcb *next = pick(os_ring->next);
        while (os_ring->next != next) {
            os_ring = os_ring->next;
        }
    }
    os_in_kernel = false;
    return dispatch(os_ring->next);
}

sys_pcb *os_slice_end(sys_pcb *running)
{
    os_ring = running; /* it was os_ring->next: the ring turns by one */
    if (HAL_LIKELY(os_pending == 0)) {
        return dispatch(running->next);
    }
    return os_schedule();
}

void Sys_Yield(void)
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
    if (pick_thread == NULL) {
        os_pending &= (uint16)~OS_CHOICE;
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
    (void)Sys_Send_IntEvent(SYS_DEADLINE_MISSED, p->pid);
}

static bool is_late(const periodic *timing, uint16 now)
{
    return (sint16)(now - timing->due) > 0;
}

/* A job that is late has no deadline to meet any more: it takes turns with the threads without a period, which run when
 * no job is on time. So whatever it does, it starves nobody. */
static sys_pcb *earliest_deadline(sys_pcb *first)
{
    uint16 now = clock_now();
    sys_pcb *best = first;
    const periodic *earliest = NULL;
    sys_pcb *p = first;
    do {
        if ((p->status & (SYS_PERIODIC | OS_MISSED)) == SYS_PERIODIC) {
            const periodic *timing = process_periodic(p);
            if (is_late(timing, now)) {
                report_miss(p);
            } else if (earliest == NULL || (sint16)(timing->due - earliest->due) < 0) {
                earliest = timing;
                best = p;
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
    bool met = !is_late(timing, now);
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
