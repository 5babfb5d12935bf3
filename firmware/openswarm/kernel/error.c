/* What went wrong, and how often: the last error, saturating counters, and losses per event. */
#include "kernel.h"

sys_statistics os_statistics;

static volatile uint16 last_error;

/* Losses of the first SYS_LOSS_COUNTERS events that lost something; further ones share the entry before. */
static struct {
    uint16 event, count;
} losses[SYS_LOSS_COUNTERS + 1];

bool os_fail(sys_error error)
{
    last_error = (uint16)error;
    return false;
}

void os_count(uint16 *counter)
{
    hal_lock_state lock = hal_lock_devices();
    if (*counter != 0xFFFFu) {
        ++*counter;
    }
    hal_unlock(lock);
}

bool os_refuse(void)
{
    os_count(&os_statistics.refused);
    return os_fail(SYS_ERROR_CONTEXT);
}

void event_lost(uint16 id)
{
    bool counted = false;
    os_count(&os_statistics.events_lost);
    for (uint16 i = 1; i <= SYS_LOSS_COUNTERS && !counted; i++) {
        hal_lock_state lock = hal_lock_devices();
        counted = losses[i].count == 0 || losses[i].event == id;
        if (counted) {
            losses[i].event = id;
            losses[i].count = (uint16)(losses[i].count + (losses[i].count != 0xFFFFu));
        }
        hal_unlock(lock);
    }
    if (!counted) {
        os_count(&losses[0].count);
    }
}

void event_forget_losses(uint16 id)
{
    for (uint16 i = 1; i <= SYS_LOSS_COUNTERS; i++) {
        if (losses[i].event == id) {
            losses[i].count = 0;
        }
    }
}

uint16 Sys_Get_LostEvents(uint16 id)
{
    for (uint16 i = 1; i <= SYS_LOSS_COUNTERS; i++) {
        if (losses[i].count != 0 && losses[i].event == id) {
            return losses[i].count;
        }
    }
    return id == 0 ? losses[0].count : 0;
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
