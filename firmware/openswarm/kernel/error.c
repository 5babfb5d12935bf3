/* SPDX-License-Identifier: MIT */
/* Errors: the last error of each caller, saturating counters, and lost messages per event. */
#include "kernel.h"

sys_statistics os_statistics;

struct os_errors os_errors;

/* Lost messages of the first SYS_LOSS_COUNTERS events that lost one; entry 0 counts those of all other events. */
typedef struct {
    uint16 event, count;
} loss;

static loss losses[SYS_LOSS_COUNTERS + 1];

/* Returns the last error of the caller. Each thread has its own, so that no other context overwrites it before the
 * thread reads it. All handlers share one, because no handler interrupts another; all ISRs share one. */
static HAL_OUTLINE volatile uint8 *last_error(void)
{
    return hal_in_isr() ? &os_errors.isrs : os_in_kernel ? &os_errors.handlers : &os_running->time_or_error.error;
}

bool os_fail(sys_error error)
{
    *last_error() = (uint8)error;
    return false;
}

void event_announce(uint16 id, uint16 value)
{
    volatile uint8 *error = last_error();
    uint8 before = *error;
    (void)Sys_Send_IntEvent(id, value);
    *error = before;
}

void os_count(uint16 *counter)
{
    hal_lock_state lock = hal_lock_devices();
    uint16 more = (uint16)(*counter + 1u);
    if (more != 0) {
        *counter = more;
    }
    hal_unlock(lock);
}

sys_error os_refuse(void)
{
    os_count(&os_statistics.refused);
    (void)os_fail(SYS_ERROR_CONTEXT);
    return SYS_ERROR_CONTEXT;
}

/* Whether an entry counts the losses of event id. The first event that reaches a free entry claims it permanently. */
static bool belongs_to(loss *entry, uint16 id)
{
    hal_lock_state lock = hal_lock_devices();
    if (entry->event == 0) {
        entry->event = id;
    }
    bool own = entry->event == id;
    hal_unlock(lock);
    return own;
}

void event_lost(uint16 id)
{
    loss *entry = losses + SYS_LOSS_COUNTERS;
    os_count(&os_statistics.events_lost);
    while (entry != losses && (id == 0 || !belongs_to(entry, id))) {
        entry--;
    }
    os_count(&entry->count);
}

uint16 Sys_Get_LostEvents(uint16 id)
{
    const loss *entry = losses + SYS_LOSS_COUNTERS;
    while (entry != losses && (id == 0 || entry->event != id)) {
        entry--;
    }
    return entry != losses || id == 0 ? HAL_LOAD(entry->count) : 0;
}

uint16 Sys_Get_LastError(void)
{
    return *last_error();
}

const sys_statistics *Sys_Get_Statistics(void)
{
    heap_update_peak();
    return &os_statistics;
}
