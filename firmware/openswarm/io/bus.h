/* SPDX-License-Identifier: MIT */
/* A bus that one thread uses at a time, while an interrupt works on a block of the heap that belongs to the bus: never on
 * memory of the thread, which may be killed at any instruction. The block of a killed thread is freed by the next one that
 * takes the bus. */
#ifndef OS_BUS_H
#define OS_BUS_H

#include "openswarm.h"

typedef struct {
    void *block; /* NULL = nobody uses the bus */
    uint16 size, owner;
} bus;

/* T.  A block of size bytes, and with it the bus. NULL: refused, with SYS_ERROR_CONTEXT, _BUSY or _MEMORY. silence() ends
 * all interrupts of the bus; it is called before a block is freed or given out. */
void *bus_take(bus *wanted, uint16 size, void (*silence)(void));
void bus_give(bus *used, void (*silence)(void)); /* by the thread that took it */

#endif
