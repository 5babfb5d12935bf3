/* SPDX-License-Identifier: MIT */
/* Mutexes with immediate priority ceiling (openswarm_mutex.h).
 *
 * A mutex without an owner is on no list and has no waiters. Wait nodes are on the stacks of the waiting threads. */
#include "kernel.h"
#include "openswarm_mutex.h"

typedef struct sys_mutex_waiter waiter;
struct sys_mutex_waiter {
    waiter *next;
    sys_pcb *thread;
};

static sys_mutex *held; /* all mutexes with an owner; slice locked */

BOUNDS_AT("for (", loop l);
static uint8 base_priority(const sys_pcb *thread)
{
    for (const sys_mutex *m = held; m != NULL; m = m->next) {
        if (m->owner == thread) {
            return m->base;
        }
    }
    return thread->priority;
}

static void acquire(sys_mutex *m, sys_pcb *thread)
{
    m->base = base_priority(thread);
    m->owner = thread;
    m->next = held;
    held = m;
    if (thread->priority < m->ceiling) {
        thread->priority = m->ceiling;
    }
}

BOUNDS_AT("for (", loop n);
static void remove_waiter(sys_mutex *m, const sys_pcb *thread)
{
    for (waiter **link = &m->waiters; *link != NULL; link = &(*link)->next) {
        if ((*link)->thread == thread) {
            *link = (*link)->next;
            return;
        }
    }
}

/* Passes a free mutex to the waiter of the highest priority, the first of equals. A waiter whose time-out expired but
 * which has not run since is no longer blocked. */
BOUNDS_AT("for (", loop n);
static void hand_over(sys_mutex *m)
{
    sys_pcb *best = NULL;
    for (const waiter *w = m->waiters; w != NULL; w = w->next) {
        if (best == NULL || w->thread->priority > best->priority) {
            best = w->thread;
        }
    }
    if (best != NULL) {
        remove_waiter(m, best);
        acquire(m, best);
        if (best->status & OS_OFF_RING) {
            process_wake(best, NULL);
        }
    }
}

BOUNDS_AT("while (", loop l);
BOUNDS_AT("for (", loop l);
static void release(sys_mutex *m)
{
    sys_pcb *thread = m->owner;
    sys_mutex **link = &held;
    while (*link != m) {
        link = &(*link)->next;
    }
    *link = m->next;
    m->owner = NULL;
    thread->priority = m->base;
    for (const sys_mutex *other = held; other != NULL; other = other->next) {
        if (other->owner == thread && other->ceiling > thread->priority) {
            thread->priority = other->ceiling;
        }
    }
    hand_over(m);
}

/* Teardown of a thread: removes its waits and passes its mutexes on. */
BOUNDS_AT("m = m->next) {", loop l);
BOUNDS_AT("m != NULL;) {", loop l * l, one);
static void release_all(sys_pcb *thread)
{
    sys_mutex *m;
    for (m = held; m != NULL; m = m->next) {
        remove_waiter(m, thread);
    }
    for (m = held; m != NULL;) {
        if (m->owner == thread) {
            release(m);
            m = held;
        } else {
            m = m->next;
        }
    }
}

BOUNDS_AT("while (*end", loop n);
bool Sys_Lock_MutexTimeout(sys_mutex *m, uint16 ms)
{
    sys_pcb *self = os_running;
    waiter own_node = {NULL, self};
    if (os_enter_blocking() != SYS_OK) {
        return false;
    }
    if (m->owner == self) {
        return os_leave(SYS_ERROR_PROCESS);
    }
    if (base_priority(self) > m->ceiling) {
        return os_leave(SYS_ERROR_ARGUMENT);
    }
    os_release_mutexes = release_all;
    if (m->owner == NULL) {
        acquire(m, self);
        return os_leave(SYS_OK);
    }
    waiter **end = &m->waiters;
    while (*end != NULL) {
        end = &(*end)->next;
    }
    *end = &own_node;
    process_block(NULL, ms);
    section_open();
    bool mine = m->owner == self; /* the previous owner handed it over */
    if (!mine) {
        remove_waiter(m, self);
    }
    section_close();
    return mine;
}

bool Sys_Lock_Mutex(sys_mutex *m)
{
    return Sys_Lock_MutexTimeout(m, 0);
}

bool Sys_Unlock_Mutex(sys_mutex *m)
{
    if (os_enter() != SYS_OK) {
        return false;
    }
    if (os_in_kernel) {
        return os_leave(os_refuse());
    }
    if (m->owner != os_running) {
        return os_leave(SYS_ERROR_PROCESS);
    }
    uint8 raised = os_running->priority;
    release(m);
    if (os_running->priority < raised) {
        os_preempt(); /* a thread of a priority in between may be ready */
    }
    return os_leave(SYS_OK);
}
