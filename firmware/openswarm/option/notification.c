/* SPDX-License-Identifier: MIT */
/* Latched notifications (openswarm_notification.h).
 *
 * A waiting thread is on the blocked list, with the notification as the object that it awaits. Notifying only sets bits
 * and OS_POSTED; wake_notified() wakes the thread, which takes its bits when it runs: if it is killed before, they stay. */
#include "kernel.h"
#include "openswarm_notification.h"

/* Marks the wait for a notification: the condition of a wait whose object is not an event is never called. */
static bool notification_wait(sys_event_data *unused)
{
    return unused != NULL; /* differs from other marks, so that no compiler merges it with one */
}

/* Kernel stack. */
BOUNDS_AT("for (", loop n, one);
static void wake_notified(void)
{
    sys_pcb *next;
    for (sys_pcb *p = os_blocked; p != NULL; p = next) {
        next = p->next;
        if (p->event_or_slice.awaited != NULL && p->wait.condition == notification_wait) {
            const sys_notification *n = (const void *)p->event_or_slice.awaited;
            if (HAL_LOAD(n->bits) & n->awaited) {
                process_wake(p, NULL);
            }
        }
    }
}

static uint16 take(sys_notification *n, uint16 bits)
{
    hal_lock_state lock = hal_lock_devices();
    uint16 taken = n->bits & bits;
    n->bits ^= taken;
    hal_unlock(lock);
    return taken;
}

static void post(sys_notification *n, uint16 bits)
{
    hal_lock_state lock = hal_lock_devices();
    n->bits |= bits;
    os_wake_notified = wake_notified;
    os_pending |= OS_POSTED;
    hal_unlock(lock);
    if (os_eager) {
        os_preempt();
    }
}

void Sys_Notify(sys_notification *n, uint16 bits)
{
    post(n, bits);
}

void Sys_Notify_Value(sys_notification *n, uint16 bits, uint16 value)
{
    HAL_STORE(n->value, value);
    post(n, bits);
}

uint16 Sys_Wait_for_Notification(sys_notification *n, uint16 bits, uint16 ms)
{
    sys_pcb *self = os_running;
    event *object = (event *)(void *)n;
    sys_error error = bits == 0 ? SYS_ERROR_ARGUMENT : SYS_OK;
    if (os_enter_blocking() != SYS_OK) {
        return 0;
    }
    if (error == SYS_OK && process_awaits(object)) {
        error = SYS_ERROR_BUSY;
    }
    uint16 taken = error == SYS_OK ? take(n, bits) : 0;
    if (error != SYS_OK || taken != 0) {
        (void)os_leave(error);
        return taken;
    }
    event_release_result(self);
    self->wait.condition = notification_wait;
    n->awaited = bits;
    process_block(object, ms);
    return take(n, bits);
}
