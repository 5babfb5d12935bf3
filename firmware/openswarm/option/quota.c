/* SPDX-License-Identifier: MIT */
/* Limits of queued messages per event (openswarm_quota.h).
 *
 * Senders find the newest event of a bucket without a call. A quota puts a gate in front of its event: an event whose
 * number does not belong to the bucket. Senders of that bucket then miss the fast path and call apply_quota(); all others
 * pay nothing. Waiting messages are counted in the queue and the delivery batch. */
#include "kernel.h"
#include "openswarm_quota.h"

#include <string.h>

static sys_quota *quotas;
static event null_event; /* has no subscribers: a message sent to it is not stored */

/* Counts the messages of e from m on and remembers the newest one. ISRs may append messages meanwhile. */
BOUNDS_AT("for (", loop q);
static void count(message *m, const event *e, uint16 *waiting, message **newest)
{
    for (; m != NULL; m = HAL_LOAD(m->queued.next)) {
        if (m->queued.event == e) {
            *newest = m;
            ++*waiting;
        }
    }
}

BOUNDS_AT("while (e != NULL", loop m + y);
BOUNDS_AT("while (q != NULL", loop y);
TARGETS_OF(event.c / Sys_Send_Event, apply_quota);
static event *apply_quota(uint16 id, const void *data, uint16 size)
{
    event *e = *event_bucket(id);
    bool limited = false; /* true behind a gate: a quota ends with its event, which may be registered again without one */
    while (e != NULL && e->id != id) {
        limited |= e->id == (uint16)(id + 1u);
        e = e->next;
    }
    sys_quota *q = quotas;
    while (q != NULL && q->event != id) {
        q = q->next;
    }
    if (e == NULL || q == NULL || !limited) {
        return e;
    }
    uint16 waiting = 0;
    message *newest = NULL;
    count(HAL_LOAD(delivery_batch), e, &waiting, &newest);
    count(HAL_LOAD(event_queue), e, &waiting, &newest);
    if (waiting < (q->most != 0 ? q->most : 1u)) {
        return e;
    }
    if (q->most == 0 && size == newest->queued.size && size <= SYS_LATEST_PAYLOAD) {
        hal_lock_state lock = hal_lock_devices();
        memcpy((uint8 *)newest + sizeof *newest, data, size);
        hal_unlock(lock);
    } else {
        os_count(&q->dropped);
    }
    return &null_event;
}

/* Removes a quota, and the quota and gate of an event: an event has at most one of each. Slice locked. */
BOUNDS_AT("for (sys_quota", loop y, one);
BOUNDS_AT("for (event", loop m + y);
static void remove_quota(const sys_quota *again, uint16 id)
{
    for (sys_quota **link = &quotas; *link != NULL;) {
        if (*link == again || (*link)->event == id) {
            HAL_STORE(*link, (*link)->next);
        } else {
            link = &(*link)->next;
        }
    }
    for (event **link = event_bucket(id); *link != NULL; link = &(*link)->next) {
        event *gate = *link;
        if (gate->id == (uint16)(id + 1u)) {
            HAL_STORE(*link, gate->next);
            heap_free(gate, sizeof *gate);
            return;
        }
    }
}

/* Called with the slice locked. most 0: the newest payload replaces the waiting one. */
static sys_error add(sys_quota *q, uint16 id, uint16 most)
{
    if (event_find(id) == NULL) {
        return SYS_ERROR_EVENT;
    }
    remove_quota(q, id);
    event *gate = heap_alloc_lasting(sizeof *gate);
    if (gate == NULL) {
        return SYS_ERROR_MEMORY;
    }
    *q = (sys_quota){quotas, id, most, 0};
    hal_barrier();
    HAL_STORE(quotas, q);
    HAL_STORE(os_send_hook, apply_quota);
    gate->id = (uint16)(id + 1u);
    event_insert(gate, id);
    return SYS_OK;
}

bool Sys_Limit_Event(sys_quota *q, uint16 event, uint16 most)
{
    return os_enter() == SYS_OK && os_leave(most != 0 ? add(q, event, most) : SYS_ERROR_ARGUMENT);
}

bool Sys_Keep_Latest(sys_quota *q, uint16 event)
{
    return os_enter() == SYS_OK && os_leave(add(q, event, 0));
}
