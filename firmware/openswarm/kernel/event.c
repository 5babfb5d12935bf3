/* Events: registration, subscription, sending, delivery and waiting.
 *
 * A message is copied once, when it is sent, and handed to whoever listens when it is delivered: first the handlers in
 * order of subscription, then the waiting threads in order of waiting. Readers share the block; it is freed with the
 * last of them. */
#include "kernel.h"

#include <string.h>

#define PAYLOAD(m) ((uint8 *)(m) + sizeof(message))

enum { BUCKETS = 8 };                        /* a power of two */
static event *events[BUCKETS];               /* by the low bits of the identifier */
static message *queue, **queue_end;          /* devices locked */
static message *undelivered;                 /* the rest of the batch in delivery */
static subscription *next_subscriber;        /* the delivery's place in the list, moved by removals */

void event_init(void)
{
    for (uint16 i = 0; i < BUCKETS; i++) {
        events[i] = NULL;
    }
    queue = NULL;
    queue_end = &queue;
    undelivered = NULL;
    next_subscriber = NULL;
}

/* ---- Registration ------------------------------------------------------------------------------------------- */

static HAL_OUTLINE event *find_from(event *e, uint16 id)
{
    while (e != NULL && e->id != id) {
        e = e->next;
    }
    return e;
}

static HAL_INLINE event *find(uint16 id)
{
    event *first = events[id % BUCKETS];
    return first != NULL && first->id == id ? first : find_from(first, id);
}

event *event_find(uint16 id)
{
    return find_from(events[id % BUCKETS], id);
}

static HAL_OUTLINE bool event_awaited(const event *e)
{
    for (const sys_pcb *p = os_blocked; p != NULL; p = p->next) {
        if (p->awaited == e) {
            return true;
        }
    }
    return false;
}

bool Sys_IsEventRegistered(uint16 id)
{
    hal_lock_state lock = os_lock_slice();
    bool found = event_find(id) != NULL;
    hal_unlock(lock);
    return found;
}

bool Sys_Register_Event(uint16 id)
{
    if (hal_in_isr()) {
        return os_refuse();
    }
    hal_lock_state lock = os_lock_slice();
    event *e = event_find(id);
    if (e == NULL) {
        e = heap_take(sizeof *e);
        if (e != NULL) {
            e->id = id;
            e->next = events[id % BUCKETS]; /* the application's events are found before the system's */
            e->subscribers = NULL;
            hal_barrier();
            events[id % BUCKETS] = e;
        } else {
            os_fail(SYS_ERROR_MEMORY);
        }
    }
    hal_unlock(lock);
    return e != NULL;
}

static void unlink_subscription(subscription **link)
{
    subscription *s = *link;
    if (next_subscriber == s) {
        next_subscriber = s->next;
    }
    *link = s->next;
    hal_barrier();
    heap_give(s, sizeof *s);
}

static void wake_waiters_of(const event *e)
{
    sys_pcb *next;
    for (sys_pcb *p = os_blocked; p != NULL; p = next) {
        next = p->next;
        if (p->awaited == e) {
            p->awaited = NULL;
            p->wait.result = NULL;
            process_make_ready(p);
        }
    }
}

static void disown_messages(message *first, const event *e)
{
    for (message *m = first; m != NULL; m = m->queued.next) {
        if (m->queued.event == e) {
            m->queued.event = NULL;
        }
    }
}

bool Sys_Unregister_Event(uint16 id)
{
    if (hal_in_isr()) {
        return os_refuse();
    }
    hal_lock_state lock = os_lock_slice();
    event **link = &events[id % BUCKETS];
    while (*link != NULL && (*link)->id != id) {
        link = &(*link)->next;
    }
    event *e = *link;
    if (e != NULL) {
        *link = e->next; /* from here on ISRs queue nothing for it */
        hal_barrier();
        while (e->subscribers != NULL) {
            unlink_subscription(&e->subscribers);
        }
        wake_waiters_of(e);
        disown_messages(queue, e);
        disown_messages(undelivered, e);
        event_forget_losses(id);
        heap_give(e, sizeof *e);
    }
    hal_unlock(lock);
    return e != NULL || os_fail(SYS_ERROR_EVENT);
}

/* ---- Subscription ------------------------------------------------------------------------------------------- */

/* Slice locked. Finds or adds the subscription; the two failures are told apart by their error. */
static bool subscribe(event *e, uint16 pid, sys_handler handler, sys_condition condition)
{
    subscription **link = &e->subscribers;
    for (; *link != NULL; link = &(*link)->next) {
        if ((*link)->pid == pid && (*link)->handler == handler) {
            (*link)->condition = condition;
            return true;
        }
    }
    subscription *s = heap_take(sizeof *s);
    if (s == NULL) {
        return os_fail(SYS_ERROR_MEMORY);
    }
    s->next = NULL;
    s->handler = handler;
    s->condition = condition;
    s->pid = pid;
    hal_barrier();
    *link = s;
    return true;
}

bool Sys_Subscribe_to_Event(uint16 id, uint16 pid, sys_handler handler, sys_condition condition)
{
    if (hal_in_isr()) {
        return os_refuse();
    }
    if (handler == NULL) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    hal_lock_state lock = os_lock_slice();
    event *e = event_find(id);
    bool done = e == NULL                     ? os_fail(SYS_ERROR_EVENT)
                : process_find(pid) == NULL ? os_fail(SYS_ERROR_PROCESS)
                                            : subscribe(e, pid, handler, condition);
    hal_unlock(lock);
    return done;
}

/* Slice locked. handler NULL = every handler of the thread. */
static bool unsubscribe(event *e, uint16 pid, sys_handler handler)
{
    bool found = false;
    subscription **link = &e->subscribers;
    while (*link != NULL) {
        if ((*link)->pid == pid && (handler == NULL || (*link)->handler == handler)) {
            unlink_subscription(link);
            found = true;
        } else {
            link = &(*link)->next;
        }
    }
    return found;
}

bool Sys_Unsubscribe_Handler(uint16 id, uint16 pid, sys_handler handler)
{
    if (hal_in_isr()) {
        return os_refuse();
    }
    hal_lock_state lock = os_lock_slice();
    event *e = event_find(id);
    bool done = e != NULL ? unsubscribe(e, pid, handler) : os_fail(SYS_ERROR_EVENT);
    hal_unlock(lock);
    return done;
}

bool Sys_Unsubscribe_from_Event(uint16 id, uint16 pid)
{
    return Sys_Unsubscribe_Handler(id, pid, NULL);
}

void event_drop_subscriptions(uint16 pid)
{
    for (uint16 i = 0; i < BUCKETS; i++) {
        for (event *e = events[i]; e != NULL; e = e->next) {
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
        hal_slice_force();
    }
}

static HAL_OUTLINE bool refuse_message(uint16 id, sys_error error)
{
    if (error == SYS_ERROR_MEMORY) {
        event_lost(id);
    }
    return os_fail(error);
}

typedef uint16 __attribute__((may_alias)) any_word;

static HAL_INLINE void copy(void *to, const void *from, uint16 size)
{
    if (size == sizeof(any_word) && ((uintptr_t)from & 1u) == 0) { /* most events */
        *(any_word *)to = *(const any_word *)from;
    } else if (size != 0) {
        memcpy(to, from, size);
    }
}

bool Sys_Send_Event(uint16 id, const void *data, uint16 size)
{
    sys_error error = SYS_OK;
    if (HAL_UNLIKELY(size > SYS_SMALL_PAYLOAD) && (size > SYS_MAXIMUM_PAYLOAD || hal_in_isr())) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    if (HAL_UNLIKELY(data == NULL) && size != 0) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    hal_lock_state lock = hal_lock_slice();
    event *e = find(id);
    if (e == NULL) {
        error = SYS_ERROR_EVENT;
    } else if (e->subscribers != NULL || event_awaited(e)) {
        message *m = heap_take((uint16)(sizeof *m + size));
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
    const uint8 *payload = PAYLOAD(m);
    uint16 value = 0;
    if (size >= sizeof value) {
        memcpy(&value, payload, sizeof value);
    } else if (size == 1) {
        value = payload[0];
    }
    return value;
}

static void run_handlers(event *e, sys_event_data *data)
{
    uint16 id = e->id; /* a handler may unregister the event */
    next_subscriber = e->subscribers;
    while (next_subscriber != NULL) {
        subscription *s = next_subscriber;
        sys_handler handler = s->handler;
        uint16 pid = s->pid;
        next_subscriber = s->next;
        if ((s->condition == NULL || s->condition(data)) && !handler(pid, id, data)) {
            event *still = event_find(id);
            if (still != NULL) {
                (void)unsubscribe(still, pid, handler);
            }
        }
    }
}

static bool wake_waiters(const event *e, message *m)
{
    bool kept = false;
    for (sys_pcb *p = process_scan_blocked(); p != NULL; p = process_scan_next()) {
        if (p->awaited != e || (p->wait.condition != NULL && !p->wait.condition(&m->data))) {
            continue;
        }
        if (process_scan_holds(p)) { /* the condition may have killed its own thread */
            p->wait.result = m;
            process_make_ready(p);
            kept = true;
        }
    }
    return kept;
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
        kept = wake_waiters(e, m);
    }
    if (!kept) {
        heap_give(m, (uint16)(sizeof *m + size));
    }
}

void event_deliver_queued(void)
{
    hal_lock_state lock = hal_lock_devices();
    undelivered = queue;
    queue = NULL;
    queue_end = &queue;
    os_pending &= (uint16)~OS_MESSAGES;
    hal_unlock(lock);
    while (undelivered != NULL) {
        message *m = undelivered;
        undelivered = m->queued.next;
        deliver(m);
    }
}

/* ---- Waiting ------------------------------------------------------------------------------------------------ */

static bool holds(const sys_pcb *p, const message *m)
{
    return !((p->status & OS_OFF_RING) && p->awaited != NULL) && p->wait.result == m;
}

void event_release(message *m)
{
    const sys_pcb *p;
    if (os_ring != NULL) {
        p = os_ring;
        do {
            if (holds(p, m)) {
                return;
            }
            p = p->next;
        } while (p != os_ring);
    }
    for (p = os_blocked; p != NULL; p = p->next) {
        if (holds(p, m)) {
            return;
        }
    }
    heap_give(m, (uint16)(sizeof *m + m->data.size));
}

static void release_own_result(sys_pcb *self)
{
    message *m = self->wait.result;
    self->wait.result = NULL;
    if (m != NULL) {
        event_release(m);
    }
}

sys_event_data *Sys_Wait_for_ConditionTimeout(uint16 id, sys_condition condition, uint16 ms)
{
    sys_pcb *self = os_running;
    if (!hal_in_thread()) {
        os_refuse();
        return NULL;
    }
    hal_lock_state lock = os_lock_slice();
    release_own_result(self);
    event *e = event_find(id);
    if (e == NULL) {
        os_fail(SYS_ERROR_EVENT);
        hal_unlock(lock);
        return NULL;
    }
    self->wait.condition = condition;
    process_block(e, ms);
    message *m = self->wait.result;
    if (m == NULL) {
        os_fail(self->awaited == NULL ? SYS_ERROR_EVENT : SYS_OK);
        return NULL;
    }
    return &m->data;
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
    hal_lock_state lock = os_lock_slice();
    message *m = os_running->wait.result;
    if (m != NULL && *data == &m->data && !os_delivering) {
        release_own_result(os_running);
    }
    hal_unlock(lock);
    *data = NULL;
}
