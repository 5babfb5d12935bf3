/* SPDX-License-Identifier: MIT */
/* Events shared by neighbours (openswarm_remote.h).
 *
 * A frame contains the event, the hops left, the robot of origin and its sequence number. Per robot of origin the
 * newest sequence and those shortly before it are recorded, which identifies duplicates at any rate.
 *
 * A sender's event is transmitted when it is sent, so that neither the queue of this robot nor a quota can confuse it
 * with an arrival. As in option/quota.c, a gate in front of the event makes its senders miss the fast path; the kernel
 * then calls transmit_own(). An arrival is sent on this robot like any event.
 *
 * Records expire: a robot that restarts counts its sequence from the beginning, and must be heard. */
#include "infrared_parts.h"
#include "kernel.h"
#include "openswarm_remote.h"

#include <string.h>

enum {
    HEADER = 4,
    EVENT_BITS = 13,
    NUMBER_BITS = 11,
    SEQUENCES = 32,
    WINDOW = 16,    /* sequence numbers before the newest one that are recorded */
    GATE = 2,       /* number of the gate minus that of its event: no event of that number is in the bucket */
    TIME_SHIFT = 8  /* times of records are in units of 256 ms: 16 bits are four hours */
};

typedef struct {
    uint16 event;
    uint8 hops; /* 0: free */
} shared_event;

typedef struct {
    uint16 newest; /* number of the robot; its newest sequence in the upper bits. 0: free */
    uint16 older;  /* bit i: the sequence newest - 1 - i has arrived */
    uint16 when;
} origin_record;

static shared_event shared[SYS_REMOTE_EVENTS];
static origin_record origins[SYS_REMOTE_MEMORY]; /* written by the link's interrupt */
static bool is_arriving; /* the interrupt sends an arrival on this robot; it ends before other code runs */
static uint8 sequence; /* devices locked */
static sys_remote_statistics statistics;

/* Returns the link to the gate of an event, or NULL. A gate behind its event belongs to a former event of its number. */
BOUNDS_AT("for (event **link", loop b);
static event **gate_of(uint16 id, bool in_front_only)
{
    for (event **link = event_bucket(id); *link != NULL; link = &(*link)->next) {
        if ((*link)->id == (uint16)(id + GATE)) {
            return link;
        }
        if (in_front_only && (*link)->id == id) {
            break;
        }
    }
    return NULL;
}

static bool is_shared(const shared_event *s)
{
    return s->hops != 0 && event_find(s->event) != NULL && gate_of(s->event, true) != NULL;
}

static shared_event *find(uint16 id)
{
    for (shared_event *s = shared; s != shared + SYS_REMOTE_EVENTS; s++) {
        if (s->event == id && is_shared(s)) {
            return s;
        }
    }
    return NULL;
}

static bool transmit(uint16 id, uint8 hops, uint16 origin, const void *data, uint8 size)
{
    uint8 payload[HEADER + SYS_REMOTE_BYTES];
    uint16 first = (uint16)(id | (uint16)hops << EVENT_BITS);
    payload[0] = (uint8)first;
    payload[1] = (uint8)(first >> 8);
    payload[2] = (uint8)origin;
    payload[3] = (uint8)(origin >> 8);
    if (size != 0) {
        memcpy(payload + HEADER, data, size);
    }
    return queue_frame(FRAME_EVENT, payload, (uint8)(HEADER + size));
}

/* Any context, before the event is sent on this robot. */
TARGETS_OF(event.c / Sys_Send_Event, transmit_own);
static void transmit_own(uint16 id, const void *data, uint16 size)
{
    const shared_event *s = is_arriving ? NULL : find(id);
    if (s == NULL) {
        return;
    }
    if (size > SYS_REMOTE_BYTES) {
        os_count(&statistics.too_long);
        return;
    }
    hal_lock_state lock = hal_lock_devices();
    uint8 own = (uint8)((sequence + 1u) % SEQUENCES);
    sequence = own;
    hal_unlock(lock);
    uint16 origin = (uint16)(HAL_LOAD(infrared_number) | (uint16)own << NUMBER_BITS);
    if (transmit(id, s->hops, origin, data, (uint8)size)) {
        os_count(&statistics.shared);
    }
}

/* Returns the record of a robot, or a free one; NULL if all are in use by other robots heard lately. */
static origin_record *record_of(uint16 number, uint16 now)
{
    origin_record *unused = NULL;
    for (origin_record *r = origins; r != origins + SYS_REMOTE_MEMORY; r++) {
        if ((uint16)(now - r->when) > SYS_NEIGHBOUR_LIFETIME >> TIME_SHIFT) {
            r->newest = 0;
        }
        if (r->newest == 0) {
            unused = r;
        } else if ((r->newest & NUMBER_MASK) == number) {
            return r;
        }
    }
    return unused;
}

/* Records an arrival; false: it is a duplicate. */
static bool record(origin_record *r, uint16 origin, uint16 now)
{
    uint16 ahead = ((origin >> NUMBER_BITS) - (r->newest >> NUMBER_BITS)) & (SEQUENCES - 1u);
    if (r->newest == 0) {
        r->newest = origin;
        r->older = 0;
    } else if (ahead == 0) {
        return false;
    } else if (ahead < WINDOW) {
        r->older = (uint16)((r->older << 1 | 1u) << (ahead - 1u));
        r->newest = origin;
    } else {
        uint16 bit = (uint16)(1u << (SEQUENCES - 1u - ahead));
        if (r->older & bit) {
            return false;
        }
        r->older |= bit;
    }
    r->when = now;
    return true;
}

/* ISR. */
static void arrive(const frame *f)
{
    if (f->size < HEADER || f->size > HEADER + SYS_REMOTE_BYTES) {
        return;
    }
    const uint8 *data = f->payload + HEADER;
    uint8 size = (uint8)(f->size - HEADER);
    uint16 first = (uint16)(f->payload[0] | (uint16)f->payload[1] << 8);
    uint16 origin = (uint16)(f->payload[2] | (uint16)f->payload[3] << 8);
    uint16 id = first & SYS_REMOTE_LAST_EVENT;
    uint8 hops = (uint8)(first >> EVENT_BITS);
    uint16 now = (uint16)(Sys_Get_SystemTime() >> TIME_SHIFT);
    if ((origin & NUMBER_MASK) == 0) { /* sent before the robot had drawn its number */
        origin |= f->number;
    }
    if ((origin & NUMBER_MASK) == infrared_number) {
        os_count(&statistics.duplicates);
        return;
    }
    origin_record *r = record_of(origin & NUMBER_MASK, now);
    if (r == NULL) {
        os_count(&statistics.refused);
        return;
    }
    if (!record(r, origin, now)) {
        os_count(&statistics.duplicates);
        return;
    }
    os_count(&statistics.arrived);
    if (hops > 1 && transmit(id, (uint8)(hops - 1u), origin, data, size)) {
        os_count(&statistics.passed_on);
    }
    if (find(id) != NULL) {
        is_arriving = true;
        (void)Sys_Send_Event(id, data, size);
        is_arriving = false;
    }
}

static void remove_gate(uint16 id)
{
    event **link = gate_of(id, false);
    if (link != NULL) {
        event *gate = *link;
        HAL_STORE(*link, gate->next);
        heap_free(gate, sizeof *gate);
    }
}

static sys_error share(uint16 id, uint8 hops)
{
    shared_event *s = find(id);
    if (event_find(id) == NULL) {
        return SYS_ERROR_EVENT;
    }
    if (s == NULL) {
        s = shared;
        while (is_shared(s)) {
            if (++s == shared + SYS_REMOTE_EVENTS) {
                return SYS_ERROR_BUSY;
            }
        }
        event *gate = heap_alloc_lasting(sizeof *gate);
        if (gate == NULL) {
            return SYS_ERROR_MEMORY;
        }
        if (s->hops != 0) {
            remove_gate(s->event); /* the gate of an unregistered event */
        }
        s->hops = 0;
        hal_barrier();
        s->event = id;
        remove_gate(id);
        gate->id = (uint16)(id + GATE);
        event_insert(gate, id);
        HAL_STORE(os_share_hook, transmit_own);
        HAL_STORE(infrared_event_sink, arrive);
    }
    hal_barrier();
    s->hops = hops;
    return SYS_OK;
}

bool Sys_Share_Event(uint16 id, uint8 hops)
{
    if (id > SYS_REMOTE_LAST_EVENT || hops == 0 || hops > SYS_REMOTE_HOPS) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    return os_enter() == SYS_OK && os_leave(share(id, hops));
}

const sys_remote_statistics *Sys_Get_RemoteStatistics(void)
{
    return &statistics;
}
