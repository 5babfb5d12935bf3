/* SPDX-License-Identifier: MIT */
/* Mutexes with immediate priority ceiling. Linked only where used. Contract lines: openswarm.h.
 *
 *     static sys_mutex bus = SYS_MUTEX(3);          3: the highest priority of the threads that use it
 *     ...
 *     Sys_Lock_Mutex(&bus);
 *
 * The owner of a mutex runs at the mutex's ceiling priority. Under sys_fixed_priority no thread of a priority in
 * between can therefore delay the threads that use it: a thread waits for at most one section of a lower thread, and
 * threads that do not block while they own a mutex cannot deadlock. Under the other schedulers, which ignore
 * priorities, a mutex only excludes. When a mutex is unlocked or its owner ends, it passes to the waiter of the
 * highest priority, the first of equals. Mutexes may be unlocked in any order. */
#ifndef OPENSWARM_MUTEX_H
#define OPENSWARM_MUTEX_H

#include "openswarm.h"

/* Private to the kernel except for ceiling. Its memory must exist while it has an owner. */
typedef struct sys_mutex {
    struct sys_mutex *next;
    struct sys_pcb *owner;
    struct sys_mutex_waiter *waiters;
    uint8 ceiling, base;
} sys_mutex;

#define SYS_MUTEX(highest_priority) {NULL, NULL, NULL, (highest_priority), 0}

/* T | while another thread owns it | 149, 14 more per mutex that others own; 243 to the next thread if it blocks | 34,
 * with a time-out 50 | CONTEXT, PROCESS: the caller owns it already, ARGUMENT: the caller's priority is above the
 * ceiling.  Needs no heap. An uncleared wait result stays. */
bool Sys_Lock_Mutex(sys_mutex *mutex);
/* The same; false with SYS_OK also after ms milliseconds. ms 0 = no time-out. */
bool Sys_Lock_MutexTimeout(sys_mutex *mutex, uint16 ms);
/* MT | no | 133, 13 more per mutex that others own; 257 if the scheduler chooses again
 * because the caller's priority falls; 268 if a thread waits, 13 more per further one and 27 per mutex that others
 * own; 425 until a waiter of higher priority continues, 856 until the caller does if that thread unlocks and sleeps
 * | 34 | CONTEXT, PROCESS: the caller does not own it. */
bool Sys_Unlock_Mutex(sys_mutex *mutex);

#endif
