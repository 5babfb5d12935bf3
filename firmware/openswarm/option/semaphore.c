/* SPDX-License-Identifier: MIT */
/* Counting semaphores (openswarm_semaphore.h).
 *
 * A waiting thread is on the blocked list, with the semaphore as the object that it awaits. A signal only counts and
 * sets OS_POSTED; grant() passes units to threads on the kernel stack. A signal between a thread's check and its wait
 * is therefore granted when the thread blocks. */
#include "kernel.h"
#include "openswarm_semaphore.h"

enum { GRANTED = 0xFF }; /* last error of a thread that has got a unit, until it runs */

/* Marks the wait for a semaphore: the condition of a wait whose object is not an event is never called. */
static bool semaphore_wait(sys_event_data *unused)
{
    (void)unused;
    return false;
}

static bool takes_unit(sys_semaphore *s)
{
    hal_lock_state lock = hal_lock_devices();
    bool any = s->count != 0;
    if (any) {
        s->count--;
    }
    hal_unlock(lock);
    return any;
}

/* Kernel stack: passes units to threads in order of waiting. */
BOUNDS_AT("for (", loop n, one);
static void grant(void)
{
    sys_pcb *next;
    for (sys_pcb *p = os_blocked; p != NULL; p = next) {
        next = p->next;
        if (p->event_or_slice.awaited != NULL && p->wait.condition == semaphore_wait &&
            takes_unit((sys_semaphore *)(void *)p->event_or_slice.awaited)) {
            process_wake(p, NULL);
            p->time_or_error.error = GRANTED;
        }
    }
}

bool Sys_Signal_Semaphore(sys_semaphore *s)
{
    hal_lock_state lock = hal_lock_devices();
    uint16 units = (uint16)(s->count + 1u);
    if (units != 0) {
        s->count = units;
        os_grant_semaphores = grant;
        os_pending |= OS_POSTED;
    }
    hal_unlock(lock);
    if (units == 0) {
        return os_fail(SYS_ERROR_BUSY);
    }
    if (os_eager) {
        os_preempt();
    }
    return true;
}

bool Sys_Wait_for_SemaphoreTimeout(sys_semaphore *s, uint16 ms)
{
    sys_pcb *self = os_running;
    event *object = (event *)(void *)s;
    if (os_enter_blocking() != SYS_OK) {
        return false;
    }
    if (!process_awaits(object) && takes_unit(s)) {
        return os_leave(SYS_OK);
    }
    event_release_result(self);
    self->wait.condition = semaphore_wait;
    process_block(object, ms);
    if (self->time_or_error.error != GRANTED) {
        return false;
    }
    self->time_or_error.error = SYS_OK;
    return true;
}

bool Sys_Wait_for_Semaphore(sys_semaphore *s)
{
    return Sys_Wait_for_SemaphoreTimeout(s, 0);
}
