/* SPDX-License-Identifier: MIT */
/* Events shared by neighbours (openswarm_remote.h).
 *
 * A frame contains the event, the hops left, the robot of origin and its sequence number; origin and sequence identify
 * duplicates. An arrival is sent on this robot like any event. It therefore also reaches the handler that sends local
 * events to neighbours, which recognises the arrival by its contents. Two arrivals with equal contents may be confused;
 * the difference has no effect.
 *
 * Arrivals expire: a robot that restarts counts its sequence from the beginning, and must be heard. */
#include "infrared_parts.h"
#include "kernel.h"
#include "openswarm_remote.h"

#include <string.h>

enum {
    HEADER = 4,
    EVENT_BITS = 13,
    NUMBER_BITS = 11,
    SEQUENCES = 32,
    TIME_SHIFT = 8 /* arrival times are in units of 256 ms: 16 bits are four hours */
};

typedef struct {
    uint16 event;
    uint8 hops; /* 0: free */
} shared_event;

typedef struct {
    uint16 origin;   /* number of the robot; its sequence in the upper bits */
    uint16 contents; /* CRC of the contents */
    uint16 when;
    bool is_pending; /* sent on this robot, and not yet seen by on_event() */
} arrival;

static shared_event shared[SYS_REMOTE_EVENTS];
static arrival arrivals[SYS_REMOTE_MEMORY]; /* written by the link's interrupt */
static uint8 next_arrival, sequence;
static sys_remote_statistics statistics;

static uint16 contents_of(uint16 event, const uint8 *data, uint16 size)
{
    return (uint16)(coder_crc(data, (uint8)size) + event * 0x9E37u);
}

static shared_event *find(uint16 event)
{
    for (shared_event *s = shared; s != shared + SYS_REMOTE_EVENTS; s++) {
        if (s->hops != 0 && s->event == event) {
            return s;
        }
    }
    return NULL;
}

static uint16 date(void)
{
    return (uint16)(Sys_Get_SystemTime() >> TIME_SHIFT);
}

static bool is_recent(const arrival *a)
{
    return a->origin != 0 && (uint16)(date() - a->when) <= SYS_NEIGHBOUR_LIFETIME >> TIME_SHIFT;
}

/* Whether an event with these contents is a pending arrival, which it then ends. */
static bool has_arrived(uint16 contents)
{
    bool found = false;
    for (arrival *a = arrivals; a != arrivals + SYS_REMOTE_MEMORY && !found; a++) {
        hal_lock_state lock = hal_lock_devices();
        if (a->is_pending && a->contents == contents) {
            a->is_pending = false;
            found = is_recent(a);
        }
        hal_unlock(lock);
    }
    return found;
}

static bool transmit(uint16 event, uint8 hops, uint16 origin, const void *data, uint8 size)
{
    uint8 payload[HEADER + SYS_REMOTE_BYTES];
    uint16 first = (uint16)(event | (uint16)hops << EVENT_BITS);
    payload[0] = (uint8)first;
    payload[1] = (uint8)(first >> 8);
    payload[2] = (uint8)origin;
    payload[3] = (uint8)(origin >> 8);
    memcpy(payload + HEADER, data, size);
    return queue_frame(FRAME_EVENT, payload, (uint8)(HEADER + size));
}

static bool on_event(uint16 pid, uint16 event, sys_event_data *data)
{
    const shared_event *s = find(event);
    (void)pid;
    if (s == NULL || data->size > SYS_REMOTE_BYTES) {
        os_count(&statistics.too_long);
    } else if (!has_arrived(contents_of(event, data->payload, data->size))) {
        sequence = (uint8)((sequence + 1u) % SEQUENCES);
        uint16 origin = (uint16)(HAL_LOAD(infrared_number) | (uint16)sequence << NUMBER_BITS);
        if (transmit(event, s->hops, origin, data->payload, (uint8)data->size)) {
            os_count(&statistics.shared);
        }
    }
    return true;
}

static bool is_known(uint16 origin)
{
    if ((origin & NUMBER_MASK) == infrared_number) {
        return true;
    }
    for (const arrival *a = arrivals; a != arrivals + SYS_REMOTE_MEMORY; a++) {
        if (a->origin == origin && is_recent(a)) {
            return true;
        }
    }
    return false;
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
    uint16 event = first & SYS_REMOTE_LAST_EVENT;
    uint8 hops = (uint8)(first >> EVENT_BITS);
    if ((origin & NUMBER_MASK) == 0) { /* sent before the robot had drawn its number */
        origin |= f->number;
    }
    if (is_known(origin)) {
        os_count(&statistics.duplicates);
        return;
    }
    arrival *a = arrivals + next_arrival;
    if (a->is_pending && is_recent(a)) { /* handlers lag behind: once displaced, it would count as a local event */
        return;
    }
    next_arrival = (uint8)((next_arrival + 1u) % SYS_REMOTE_MEMORY);
    *a = (arrival){origin, contents_of(event, data, size), date(), false};
    os_count(&statistics.arrived);
    if (hops > 1 && transmit(event, (uint8)(hops - 1u), origin, data, size)) {
        os_count(&statistics.passed_on);
    }
    if (find(event) != NULL) {
        a->is_pending = Sys_Send_Event(event, data, size);
    }
}

bool Sys_Share_Event(uint16 event, uint8 hops)
{
    if (event > SYS_REMOTE_LAST_EVENT || hops == 0 || hops > SYS_REMOTE_HOPS) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    Sys_Start_CriticalSection();
    shared_event *s = find(event);
    for (shared_event *f = shared; s == NULL && f != shared + SYS_REMOTE_EVENTS; f++) {
        s = f->hops == 0 ? f : NULL;
    }
    bool is_done = s != NULL ? Sys_Subscribe_to_Event(event, OS_DRIVERS, on_event, NULL) : os_fail(SYS_ERROR_BUSY);
    if (is_done) {
        s->event = event;
        hal_barrier();
        s->hops = hops;
        HAL_STORE(infrared_event_sink, arrive);
    }
    Sys_End_CriticalSection();
    return is_done;
}

const sys_remote_statistics *Sys_Get_RemoteStatistics(void)
{
    return &statistics;
}
