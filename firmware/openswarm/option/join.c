/* SPDX-License-Identifier: MIT */
/* Joining threads, and joinable threads that stay as zombies until another thread joins them (openswarm_join.h). */
#include "kernel.h"
#include "openswarm_join.h"

typedef struct joiner joiner;
struct joiner { /* on the waiting thread's stack */
    joiner *next;
    sys_pcb *thread;
    uint16 pid;
};

static joiner *joiners; /* slice locked */

/* Teardown of a thread: wakes the threads that join it, which then do not need a zombie, and drops its own join. */
BOUNDS_AT("for (", loop n, one);
static void release_joins(sys_pcb *gone)
{
    for (joiner **link = &joiners; *link != NULL;) {
        joiner *j = *link;
        if (j->thread != gone && j->pid != gone->pid) {
            link = &j->next;
        } else {
            *link = j->next;
            if (j->thread != gone) {
                if (j->thread->status & OS_OFF_RING) { /* else its time-out expired and it has not run since */
                    process_wake(j->thread, NULL);
                }
                gone->status &= (uint8)~OS_JOINABLE;
            }
        }
    }
}

/* Keeps the control block of a joinable thread at the end of the blocked list. Killing the zombie frees the block. */
BOUNDS_AT("while (*end", loop n);
static bool free_joinable(sys_pcb *p)
{
    if (p->block == NULL) {
        heap_free(p, sizeof *p);
        return true;
    }
    if (!(p->status & OS_JOINABLE)) {
        return false;
    }
    hal_stack_release(p);
    heap_free(p->block, (uint16)((uint8 *)p - p->block));
    p->block = NULL;
    p->event_or_slice.awaited = NULL;
    p->next = NULL;
    sys_pcb **end = &os_blocked;
    while (*end != NULL) {
        end = &(*end)->next;
    }
    hal_barrier();
    HAL_STORE(*end, p);
    return true;
}

uint16 Sys_Start_Joinable(const sys_process_config *config)
{
    sys_process_config joinable = *config;
    os_free_joinable = free_joinable;
    os_release_joins = release_joins;
    joinable.flags |= OS_JOINABLE;
    return Sys_Start_ProcessWith(&joinable);
}

/* Returns the thread that a thread joins, or NULL. */
BOUNDS_AT("for (", loop n);
static const sys_pcb *joined_by(const sys_pcb *thread)
{
    for (const joiner *j = joiners; j != NULL; j = j->next) {
        if (j->thread == thread) {
            return process_find(j->pid);
        }
    }
    return NULL;
}

BOUNDS_AT("for (const sys_pcb *next", loop n);
BOUNDS_AT("while (*link != p)", loop n);
BOUNDS_AT("for (joiner **link", loop n);
bool Sys_JoinTimeout(uint16 pid, uint16 ms)
{
    if (os_enter_blocking() != SYS_OK) {
        return false;
    }
    const sys_pcb *p = process_find(pid);
    if (p == NULL || p == &os_system) {
        return os_leave(SYS_ERROR_PROCESS);
    }
    for (const sys_pcb *next = p; next != NULL; next = joined_by(next)) {
        if (next == os_running) {
            return os_leave(SYS_ERROR_PROCESS); /* it would wait for itself */
        }
    }
    if ((p->status & OS_STATE) == SYS_ZOMBIE) {
        sys_pcb **link = &os_blocked;
        while (*link != p) {
            link = &(*link)->next;
        }
        HAL_STORE(*link, p->next);
        event_drop_subscriptions(pid); /* other threads may have subscribed it after its end */
        heap_free((void *)(uintptr_t)p, sizeof *p);
        return os_leave(SYS_OK);
    }
    os_release_joins = release_joins;
    joiner waiting = {joiners, os_running, pid};
    joiners = &waiting;
    process_block(NULL, ms);
    bool ended = true;
    section_open();
    for (joiner **link = &joiners; *link != NULL; link = &(*link)->next) {
        if (*link == &waiting) { /* release_joins() would have removed it */
            *link = waiting.next;
            ended = false;
            break;
        }
    }
    section_close();
    return ended;
}

bool Sys_Join(uint16 pid)
{
    return Sys_JoinTimeout(pid, 0);
}
