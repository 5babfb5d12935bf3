/* SPDX-License-Identifier: MIT */
/* A bus that one thread uses at a time. The interrupt works on a heap block that belongs to the bus, never on the
 * thread's memory, because the thread may be killed at any instruction. The next thread that takes the bus frees the
 * block of a killed one. */
#ifndef OS_BUS_H
#define OS_BUS_H

#include "openswarm.h"

typedef struct {
    void *block; /* NULL = the bus is free */
    uint16 size, owner;
} bus;

/* T.  Takes the bus and returns a block of size bytes. NULL: refused, with SYS_ERROR_CONTEXT, _BUSY or _MEMORY.
 * silence() disables all interrupts of the bus; it is called before a block is freed or returned. */
void *bus_take(bus *wanted, uint16 size, void (*silence)(void));
void bus_give(bus *used, void (*silence)(void)); /* releases the bus; by the thread that took it */

#endif
