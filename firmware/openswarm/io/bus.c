/* SPDX-License-Identifier: MIT */
/* Ownership of a bus (bus.h). */
#include "bus.h"

#include "kernel.h"

/* Whether the thread that took the bus still lives. OS_USES_BUS ends with the thread, so that a later thread with
 * the same PID is not mistaken for it. */
static bool is_used(const bus *b)
{
    const sys_pcb *owner = b->block != NULL ? process_find(b->owner) : NULL;
    return owner != NULL && (owner->status & OS_USES_BUS);
}

void *bus_take(bus *wanted, uint16 size, void (*silence)(void))
{
    sys_error error = SYS_ERROR_BUSY;
    void *block = NULL;
    if (os_enter_blocking() != SYS_OK) {
        return NULL;
    }
    if (!is_used(wanted)) {
        silence();
        if (wanted->block != NULL) {
            heap_free(wanted->block, wanted->size);
        }
        block = heap_alloc(size);
        wanted->block = block;
        wanted->size = size;
        wanted->owner = os_running->pid;
        error = SYS_ERROR_MEMORY;
        if (block != NULL) {
            os_running->status |= OS_USES_BUS;
            error = SYS_OK;
        }
    }
    (void)os_leave(error);
    return block;
}

void bus_give(bus *used, void (*silence)(void))
{
    section_open();
    silence();
    heap_free(used->block, used->size);
    used->block = NULL;
    os_running->status &= (uint8)~OS_USES_BUS;
    section_close();
}
