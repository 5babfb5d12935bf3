/* SPDX-License-Identifier: MIT */
/* Events: registration, subscription, sending, delivery and waiting.
 *
 * The sender's payload is copied once, into a message. Delivery passes the message first to the handlers in order of
 * subscription, then to the waiting threads in order of waiting. Readers share the block; the last one frees it. */
#include "kernel.h"

LINKS_IN_RAM();

#include <string.h>

#define PAYLOAD(m) ((uint8 *)(m) + sizeof(message))

enum { BUCKETS = 8 };                        /* a power of two */
static event *events[BUCKETS];               /* hash table indexed by the low bits of the identifier */
message *event_queue;                        /* devices locked */
message **queue_end;                         /* devices locked */
message *delivery_batch;                     /* messages of the current delivery round not yet delivered */
event *(*os_send_hook)(uint16 id, const void *data, uint16 size);
void (*os_share_hook)(uint16 id, const void *data, uint16 size);
static subscription *const no_subscription;  /* an empty list */
static subscription *const *delivery_cursor; /* link to the next subscriber; adjusted when subscriptions change */

void event_init(void)
{
    queue_end = &event_queue;
}

/* ---- Registration ------------------------------------------------------------------------------------------- */

/* Returns the link that points to the event, or the NULL link at the end of its bucket. */
LOOPS_OF(link_of, b);
static HAL_OUTLINE event **link_of(uint16 id)
{
    event **link = &events[id % BUCKETS];
    while (*link != NULL && (*link)->id != id) {
        link = &(*link)->next;
    }
    return link;
}

event *event_find(uint16 id)
{
    return *link_of(id);
}

/* Finds the event of a sender. The most recently registered event of a bucket is found without a call. */
static HAL_INLINE event *find(uint16 id, const void *data, uint16 size)
{
    event *first = events[id % BUCKETS];
    if (first != NULL && first->id == id) {
        return first;
    }
    if (os_share_hook != NULL) {
        os_share_hook(id, data, size);
    }
    return os_send_hook == NULL ? event_find(id) : os_send_hook(id, data, size);
}

LOOPS_OF(first_waiter, n);
static HAL_OUTLINE const sys_pcb *first_waiter(const event *e)
{
    const sys_pcb *p = os_blocked;
    while (p != NULL && p->event_or_slice.awaited != e) {
        p = p->next;
    }
    return p;
}

bool Sys_IsEventRegistered(uint16 id)
{
    hal_lock_state lock = hal_lock_slice();
    bool found = event_find(id) != NULL;
    hal_unlock(lock);
    return found;
}

event **event_bucket(uint16 id)
{
    return &events[id % BUCKETS];
}

void event_insert(event *e, uint16 id)
{
    event **first = &events[id % BUCKETS];
    e->next = *first;
    e->subscribers = NULL;
    hal_barrier();
    HAL_STORE(*first, e);
}

bool Sys_Register_Event(uint16 id)
{
    sys_error error = SYS_OK;
    if (os_enter() != SYS_OK) {
        return false;
    }
    if (event_find(id) == NULL) {
        event *e = heap_alloc_lasting(sizeof *e);
        if (e != NULL) {
            e->id = id;
            event_insert(e, id); /* at the head: lookups reach the application's events before the system's */
        } else {
            error = SYS_ERROR_MEMORY;
        }
    }
    return os_leave(error);
}

static HAL_OUTLINE void unlink_subscription(subscription **link)
{
    subscription *s = *link;
    if (delivery_cursor == &s->next) {
        delivery_cursor = link;
    }
    HAL_STORE(*link, s->next);
    heap_free(s, sizeof *s);
}

/* Wakes the threads that wait for e without a condition. m = NULL: wakes all, because e is being unregistered. */
LOOPS_OF(wake_waiters, n);
static HAL_OUTLINE bool wake_waiters(const event *e, message *m)
{
    bool any = false;
    sys_pcb *next;
    for (sys_pcb *p = os_blocked; p != NULL; p = next) {
        next = p->next;
        if (p->event_or_slice.awaited == e && (m == NULL || p->wait.condition == NULL)) {
            process_wake(p, m);
            p->time_or_error.error = m != NULL ? SYS_OK : SYS_ERROR_EVENT;
            any = true;
        }
    }
    return any;
}

/* Clears the event of every message of e from m on, so that delivery drops the message. */
BOUNDS_AT("for (; m != NULL", loop q, total q);
static HAL_OUTLINE void detach_messages(message *m, const event *e)
{
    for (; m != NULL; m = HAL_LOAD(m->queued.next)) {
        if (m->queued.event == e) {
            m->queued.event = NULL;
        }
    }
}

BOUNDS_AT("while (e->subscribers", loop s);
bool Sys_Unregister_Event(uint16 id)
{
    if (os_enter() != SYS_OK) {
        return false;
    }
    event **link = link_of(id);
    event *e = *link;
    if (e == NULL) {
        return os_leave(SYS_ERROR_EVENT);
    }
    HAL_STORE(*link, e->next); /* from here on ISRs queue no message for it */
    while (e->subscribers != NULL) {
        unlink_subscription(&e->subscribers);
    }
    if (delivery_cursor == &e->subscribers) {
        delivery_cursor = &no_subscription;
    }
    (void)wake_waiters(e, NULL);
    detach_messages(HAL_LOAD(event_queue), e);
    detach_messages(delivery_batch, e);
    heap_free(e, sizeof *e);
    return os_leave(SYS_OK);
}

/* ---- Subscription ------------------------------------------------------------------------------------------- */

/* Updates the subscription or adds it. Slice locked. */
BOUNDS_AT("while (s != NULL", loop s);
BOUNDS_AT("while (*link != NULL", loop s);
static sys_error subscribe(uint16 id, uint16 pid, sys_handler handler, sys_condition condition)
{
    event *e = event_find(id);
    if (e == NULL) {
        return SYS_ERROR_EVENT;
    }
    subscription *s = e->subscribers, **link = &e->subscribers;
    while (s != NULL && (s->pid != pid || s->handler != handler)) {
        s = s->next;
    }
    if (s == NULL) {
        s = heap_alloc_lasting(sizeof *s);
        if (s == NULL) {
            return SYS_ERROR_MEMORY;
        }
        while (*link != NULL && link != delivery_cursor) { /* after the cursor it would get the current message, too */
            link = &(*link)->next;
        }
        if (link == delivery_cursor) {
            delivery_cursor = &s->next;
        }
        s->next = *link;
        s->handler = handler;
        s->pid = pid;
        hal_barrier();
        HAL_STORE(*link, s);
    }
    s->condition = condition;
    return SYS_OK;
}

bool Sys_Subscribe_to_Event(uint16 id, uint16 pid, sys_handler handler, sys_condition condition)
{
    if (os_enter() != SYS_OK) {
        return false;
    }
    return os_leave(handler == NULL             ? SYS_ERROR_ARGUMENT
                    : process_find(pid) == NULL ? SYS_ERROR_PROCESS
                                                : subscribe(id, pid, handler, condition));
}

bool event_connect(uint16 id, sys_handler handler)
{
    return os_enter() == SYS_OK && os_leave(subscribe(id, OS_DRIVERS, handler, NULL));
}

/* Removes subscriptions of a thread; handler NULL = all of them. Slice locked. */
BOUNDS_AT("while (*link", loop s, total min(t, m * s), share Sys_Unsubscribe_Handler s, one);
/* A thread has o subscriptions; each is removed once. */
BOUNDS_AT("unlink_subscription(link)", often unlink_subscription Sys_Unsubscribe_Handler min(s, o),
          often unlink_subscription process.c / end_thread min(t, m * s, o));
static sys_error unsubscribe(event *e, uint16 pid, sys_handler handler)
{
    sys_error error = SYS_ERROR_PROCESS;
    subscription **link = &e->subscribers;
    while (*link != NULL) {
        if ((*link)->pid == pid && ((*link)->handler == handler || (handler == NULL && pid != OS_DRIVERS))) {
            unlink_subscription(link);
            error = SYS_OK;
        } else {
            link = &(*link)->next;
        }
    }
    return error;
}

bool Sys_Unsubscribe_Handler(uint16 id, uint16 pid, sys_handler handler)
{
    if (os_enter() != SYS_OK) {
        return false;
    }
    event *e = event_find(id);
    return os_leave(e == NULL ? SYS_ERROR_EVENT : unsubscribe(e, pid, handler));
}

bool Sys_Unsubscribe_from_Event(uint16 id, uint16 pid)
{
    return Sys_Unsubscribe_Handler(id, pid, NULL);
}

BOUNDS_AT("for (event *e", loop m, total m);
void event_drop_subscriptions(uint16 pid)
{
    for (event **bucket = events; bucket != events + BUCKETS; bucket++) {
        for (event *e = *bucket; e != NULL; e = e->next) {
            (void)unsubscribe(e, pid, NULL);
        }
    }
}

/* ---- Sending ------------------------------------------------------------------------------------------------ */

static HAL_INLINE void enqueue(message *m)
{
    m->queued.next = NULL;
    hal_lock_state lock = hal_lock_devices();
    *queue_end = m;
    queue_end = &m->queued.next;
    os_pending |= OS_MESSAGES;
    hal_unlock(lock);
    if (os_eager) {
        os_preempt();
    }
}

static HAL_OUTLINE bool refuse_message(uint16 id, sys_error error)
{
    if (error == SYS_ERROR_MEMORY) {
        event_lost(id);
    }
    return os_fail(error);
}

ARGUMENT_BOUND(Sys_Send_Event, 2, d);

typedef uint16 __attribute__((may_alias)) any_word;

static HAL_INLINE void copy(void *to, const void *from, uint16 size)
{
    if (HAL_WORD_IS_ONE_ACT && size == sizeof(any_word) && ((uintptr_t)from & 1u) == 0) { /* the common case */
        *(any_word *)to = *(const any_word *)from;
    } else if (size != 0) {
        memcpy(to, from, size);
    }
}

bool Sys_Send_Event(uint16 id, const void *data, uint16 size)
{
    sys_error error = SYS_OK;
    if (size > SYS_SMALL_PAYLOAD && (size > SYS_MAXIMUM_PAYLOAD || hal_in_isr())) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    if (data == NULL && size != 0) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    hal_lock_state lock = hal_lock_slice();
    event *e = find(id, data, size);
    if (e == NULL) {
        error = SYS_ERROR_EVENT;
    } else if (e->subscribers != NULL || first_waiter(e) != NULL) {
        message *m = heap_alloc((uint16)(sizeof *m + size));
        if (m != NULL) {
            m->queued.event = e;
            m->queued.size = size;
            copy(PAYLOAD(m), data, size);
            enqueue(m);
        } else {
            error = SYS_ERROR_MEMORY;
        }
    }
    hal_unlock(lock);
    return error == SYS_OK || refuse_message(id, error);
}

bool Sys_Send_IntEvent(uint16 id, uint16 value)
{
    return Sys_Send_Event(id, &value, sizeof value);
}

/* ---- Delivery: kernel stack, slice level ---------------------------------------------------------------------- */

static uint16 value_of(const message *m, uint16 size)
{
    const void *payload = PAYLOAD(m);
    return size >= sizeof(any_word) ? *(const any_word *)payload : size != 0 ? *(const uint8 *)payload : 0;
}

/* Calls the handlers of e. A handler or condition may end any subscription and any thread, including its own. */
BOUNDS_AT("while (", loop s);
BOUNDS_AT("s->condition(data)", calls sys_condition);
BOUNDS_AT("!handler(", calls sys_handler);
BOUNDS_AT("if (*delivery_cursor == s)", same);
static void run_handlers(const event *e, sys_event_data *data)
{
    uint16 id = e->id;
    const subscription *s;
    delivery_cursor = &e->subscribers;
    while ((s = *delivery_cursor) != NULL) {
        if ((s->condition == NULL || s->condition(data)) && *delivery_cursor == s) {
            sys_handler handler = s->handler;
            uint16 pid = s->pid;
            if (!handler(pid, id, data)) {
                event *still = event_find(id); /* NULL: the handler unregistered it */
                if (still != NULL) {
                    (void)unsubscribe(still, pid, handler);
                }
            }
        }
        if (*delivery_cursor == s) {
            delivery_cursor = &s->next;
        }
    }
}

/* Clears the condition of every waiter whose condition holds for the data. wake_waiters() wakes them afterwards: a
 * condition may kill a thread, which would free the message that the thread had just received. */
BOUNDS_AT("while (", loop n);
BOUNDS_AT("condition(data)", calls sys_condition);
BOUNDS_AT("if (*process_scan == p)", same);
static void evaluate_conditions(const event *e, sys_event_data *data)
{
    sys_pcb *p;
    process_scan = &os_blocked;
    while ((p = *process_scan) != NULL) {
        bool holds = p->event_or_slice.awaited == e && p->wait.condition != NULL && p->wait.condition(data);
        if (*process_scan == p) { /* else the condition ended the wait of its own thread */
            if (holds) {
                p->wait.condition = NULL;
            }
            process_scan = &p->next;
        }
    }
}

static void deliver(message *m)
{
    event *e = m->queued.event;
    uint16 size = m->queued.size;
    bool kept = false;
    if (e != NULL) {
        m->data.size = size;
        m->data.value = value_of(m, size);
        m->data.payload = PAYLOAD(m);
        run_handlers(e, &m->data);
        evaluate_conditions(e, &m->data);
        kept = wake_waiters(e, m);
    }
    if (!kept) {
        heap_free_deferred(m, (uint16)(sizeof *m + size));
    }
}

BOUNDS_AT("while (", loop q, one);
void event_deliver_queued(void)
{
    hal_lock_state lock = hal_lock_devices();
    delivery_batch = event_queue;
    event_queue = NULL;
    queue_end = &event_queue;
    os_pending &= (uint16)~OS_MESSAGES;
    hal_unlock(lock);
    while (delivery_batch != NULL) {
        message *m = delivery_batch;
        delivery_batch = m->queued.next;
        deliver(m);
    }
    heap_coalesce();
}

/* ---- Waiting ------------------------------------------------------------------------------------------------ */

/* Whether thread p still holds m as its wait result. */
static bool holds_result(const sys_pcb *p, const message *m)
{
    return p->wait.result == m && (!(p->status & OS_OFF_RING) || p->event_or_slice.awaited == NULL);
}

BOUNDS_AT("while (", loop n, one);
void event_release_result(sys_pcb *process)
{
    message *m = process->wait.result;
    const sys_pcb *p = NULL;
    process->wait.result = NULL;
    if (m == NULL) {
        return;
    }
    while ((p = process_next(p)) != NULL) {
        if (holds_result(p, m)) {
            return;
        }
    }
    heap_free(m, (uint16)(sizeof *m + m->data.size));
}

sys_event_data *Sys_Wait_for_ConditionTimeout(uint16 id, sys_condition condition, uint16 ms)
{
    sys_pcb *self = os_running;
    if (os_enter_blocking() != SYS_OK) {
        return NULL;
    }
    event_release_result(self);
    event *e = event_find(id);
    if (e == NULL) {
        (void)os_leave(SYS_ERROR_EVENT);
        return NULL;
    }
    self->wait.condition = condition;
    process_block(e, ms);
    return (sys_event_data *)self->wait.result; /* NULL, or the message, whose event data is at offset 0 */
}

sys_event_data *Sys_Wait_for_Condition(uint16 id, sys_condition condition)
{
    return Sys_Wait_for_ConditionTimeout(id, condition, 0);
}

sys_event_data *Sys_Wait_for_Event(uint16 id)
{
    return Sys_Wait_for_ConditionTimeout(id, NULL, 0);
}

void Sys_Clear_EventData(sys_event_data **data)
{
    if (data == NULL || *data == NULL) {
        return;
    }
    if (os_enter() == SYS_OK) {
        if ((message *)*data == os_running->wait.result && !os_in_kernel) {
            event_release_result(os_running);
        }
        section_close();
    }
    *data = NULL;
}
