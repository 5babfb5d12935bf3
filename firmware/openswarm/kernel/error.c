/* What went wrong, and how often: the last error, saturating counters, and losses per event. */
#include "kernel.h"

sys_statistics os_statistics;

static volatile uint16 last_error;

/* Losses of the first SYS_LOSS_COUNTERS events that lost something; entry 0 counts those of all others. */
typedef struct {
    uint16 event, count;
} loss;

static loss losses[SYS_LOSS_COUNTERS + 1];

bool os_fail(sys_error error)
{
    last_error = (uint16)error;
    return false;
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

void event_lost(uint16 id)
{
    loss *entry = losses + SYS_LOSS_COUNTERS + 1;
    bool counted;
    os_count(&os_statistics.events_lost);
    do {
        entry--;
        hal_lock_state lock = hal_lock_devices();
        counted = entry == losses || entry->count == 0 || entry->event == id;
        if (counted) {
            uint16 more = (uint16)(entry->count + 1u);
            entry->event = id;
            if (more != 0) {
                entry->count = more;
            }
        }
        hal_unlock(lock);
    } while (!counted);
}

/* The entry of an event, or the first. */
static loss *entry_of(uint16 id)
{
    loss *entry = losses + SYS_LOSS_COUNTERS;
    while (entry != losses && (entry->count == 0 || entry->event != id)) {
        entry--;
    }
    return entry;
}

void event_forget_losses(uint16 id)
{
    loss *entry = entry_of(id);
    if (entry != losses) {
        entry->count = 0;
    }
}

uint16 Sys_Get_LostEvents(uint16 id)
{
    const loss *entry = entry_of(id);
    return entry != losses || id == 0 ? entry->count : 0;
}

uint16 Sys_Get_LastError(void)
{
    return last_error;
}

const sys_statistics *Sys_Get_Statistics(void)
{
    heap_note_peak();
    return &os_statistics;
}
