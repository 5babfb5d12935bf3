/* SPDX-License-Identifier: MIT */
/* What is to be done when a thread ends, whatever ends it (openswarm_cleanup.h). */
#include "kernel.h"
#include "openswarm_cleanup.h"

static sys_cleanup *cleanups; /* of all threads, newest first; slice locked */
static os_burial before;
static bool buries;
static const sys_pcb *dying; /* its cleanups run */

/* The link behind which the newest of a thread hangs; NULL: it has none. */
static sys_cleanup **newest_of(uint16 pid)
{
    for (sys_cleanup **link = &cleanups; *link != NULL; link = &(*link)->next) {
        if ((*link)->pid == pid) {
            return link;
        }
    }
    return NULL;
}

static bool on_burial(sys_pcb *p)
{
    sys_cleanup **link;
    const sys_pcb *outer = dying; /* a cleanup may end other threads */
    dying = p;
    while ((link = newest_of(p->pid)) != NULL) {
        const sys_cleanup *c = *link;
        *link = c->next;
        os_call_in_section(c->run, c->arg);
    }
    dying = outer;
    return before != NULL && before(p);
}

bool Sys_Push_Cleanup(sys_cleanup *c, void (*run)(void *), void *arg)
{
    if (os_enter() != SYS_OK) {
        return false;
    }
    if (os_in_kernel || dying != NULL) {
        return os_leave(os_refuse());
    }
    for (const sys_cleanup *other = cleanups; other != NULL; other = other->next) {
        if (other == c) {
            return os_leave(SYS_ERROR_ARGUMENT);
        }
    }
    if (!buries) {
        buries = true;
        before = os_at_burial;
        os_at_burial = on_burial;
    }
    *c = (sys_cleanup){cleanups, run, arg, os_running->pid};
    cleanups = c;
    return os_leave(SYS_OK);
}

bool Sys_Pop_Cleanup(bool run)
{
    if (os_enter() != SYS_OK) {
        return false;
    }
    if (os_in_kernel) {
        return os_leave(os_refuse());
    }
    sys_cleanup **link = newest_of(os_running->pid);
    if (link == NULL) {
        return os_leave(SYS_ERROR_PROCESS);
    }
    const sys_cleanup *c = *link;
    *link = c->next;
    if (run) {
        os_call_in_section(c->run, c->arg);
    }
    return os_leave(SYS_OK);
}
