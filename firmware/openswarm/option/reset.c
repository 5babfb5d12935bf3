/* SPDX-License-Identifier: MIT */
/* Reset causes and kept faults (openswarm_reset.h). */
#include "hal_reset.h"
#include "kernel.h"
#include "openswarm_reset.h"

enum { MARK = 0x5AFE };

static HAL_PERSISTENT struct { /* not cleared by a reset; arbitrary after power-on */
    uint16 mark, check;
    uint16 fault, pid, place, page;
} kept;
static sys_reset_cause cause;
static bool is_read;

static uint16 checksum(void)
{
    return (uint16)~(kept.fault ^ kept.pid ^ kept.place ^ kept.page);
}

/* Everything is masked. */
static void record(uint16 fault, uint16 place, uint16 page)
{
    kept.fault = fault;
    kept.pid = os_running->pid;
    kept.place = place;
    kept.page = page;
    kept.check = checksum();
    kept.mark = MARK;
}

const sys_reset_cause *Sys_Get_ResetCause(void)
{
    hal_lock_state lock = hal_lock_devices();
    if (!is_read) {
        is_read = true;
        cause.reset = hal_reset_cause();
        if (cause.reset != SYS_RESET_POWER && kept.mark == MARK && kept.check == checksum()) {
            cause.fault = (uint8)kept.fault;
            cause.pid = kept.pid;
            cause.place = kept.place;
            cause.page = kept.page;
        }
        kept.mark = 0;
        os_record_fault = record;
    }
    hal_unlock(lock);
    return &cause;
}
