/* SPDX-License-Identifier: MIT */
/* Mutexes with immediate priority ceiling; linked where it is used. Contract lines: openswarm.h.
 *
 *     static sys_mutex bus = SYS_MUTEX(3);          3: the highest priority of the threads that use it
 *     ...
 *     Sys_Lock_Mutex(&bus);
 *
 * Who owns the mutex has its ceiling as priority from then on, so that under sys_fixed_priority nobody of a priority in
 * between delays those who need it: such a thread waits for one section of a lower one at most, and threads that do not
 * block while they own one cannot deadlock. The other schedulers ignore priorities; there it excludes, and no more.
 * A mutex that is unlocked, or whose owner ends, goes to the waiter of the highest priority, of equal ones to the first.
 * Mutexes may be unlocked in any order. */
#ifndef OPENSWARM_MUTEX_H
#define OPENSWARM_MUTEX_H

#include "openswarm.h"

/* The kernel's, but for ceiling. Not in memory that goes while it has an owner. */
typedef struct sys_mutex {
    struct sys_mutex *next;
    struct sys_pcb *owner;
    struct sys_mutex_waiter *waiters;
    uint8 ceiling, base;
} sys_mutex;

#define SYS_MUTEX(highest_priority) {NULL, NULL, NULL, (highest_priority), 0}

/* T | while another thread owns it | 155, 9 more per mutex that others own; 241 to the next thread if it blocks | 50 | CONTEXT,
 * PROCESS: it owns it already, ARGUMENT: its priority is above the ceiling.  Takes nothing from the heap. An uncleared wait
 * result stays. */
bool Sys_Lock_Mutex(sys_mutex *mutex);
/* The same; false with SYS_OK also after ms milliseconds. ms 0 = no time-out. */
bool Sys_Lock_MutexTimeout(sys_mutex *mutex, uint16 ms);
/* T, also in a critical section | no | 133, 13 more per mutex that others own; 257 if the scheduler is to choose anew, because the
 * caller's priority falls; 268 if a thread waits, 13 more per further one and 27 per mutex that others own; 425 until a better
 * one that waited goes on, 852 until the caller does if that one gives the mutex back and sleeps | 34 | CONTEXT, PROCESS:
 * another thread owns it, or nobody. */
bool Sys_Unlock_Mutex(sys_mutex *mutex);

#endif
