/* SPDX-License-Identifier: MIT */
/* Counting semaphores. Linked only where used. Contract lines: openswarm.h.
 *
 *     static sys_semaphore items = SYS_SEMAPHORE(0);
 *     Sys_Signal_Semaphore(&items);                 producer: a thread, a handler or an ISR
 *     Sys_Wait_for_Semaphore(&items);               consumer
 *
 * A signal that comes before the wait is counted, so no wake-up is lost. Waiting threads get the units in the order in
 * which they began to wait. A unit belongs to no thread: a thread that is killed does not give it back. */
#ifndef OPENSWARM_SEMAPHORE_H
#define OPENSWARM_SEMAPHORE_H

#include "openswarm.h"

/* In static memory. */
typedef struct sys_semaphore {
    volatile uint16 count; /* units that no thread has taken */
} sys_semaphore;

#define SYS_SEMAPHORE(units) {(units)}

/* MTHI | no | 26; 387 until a waiting thread that the scheduler prefers runs | 16 | BUSY: 65535 units.  Adds a unit.
 * The next thread switch passes it to a waiting thread; under an eager scheduler that switch follows at once. */
bool Sys_Signal_Semaphore(sys_semaphore *semaphore);
/* T | while there is no unit | 123; 254 to the next thread if it blocks | 38, with a time-out 44 |
 * CONTEXT.  Takes a unit. Frees the caller's uncleared wait result if it blocks. */
bool Sys_Wait_for_Semaphore(sys_semaphore *semaphore);
/* The same; false with SYS_OK also after ms milliseconds. ms 0 = no time-out. */
bool Sys_Wait_for_SemaphoreTimeout(sys_semaphore *semaphore, uint16 ms);

#endif
