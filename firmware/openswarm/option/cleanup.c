/* SPDX-License-Identifier: MIT */
/* Cleanup functions that run when their thread ends, for whatever reason (openswarm_cleanup.h). */
#include "kernel.h"
#include "openswarm_cleanup.h"

static sys_cleanup *cleanups; /* of all threads, newest first; slice locked */
static os_thread_end_function previous_hook;
static bool hook_installed;
static const sys_pcb *dying; /* the thread whose cleanups run */

/* Returns the link to the newest cleanup of a thread, or NULL if it has none. */
static sys_cleanup **newest_of(uint16 pid)
{
    for (sys_cleanup **link = &cleanups; *link != NULL; link = &(*link)->next) {
        if ((*link)->pid == pid) {
            return link;
        }
    }
    return NULL;
}

static bool on_thread_end(sys_pcb *p)
{
    sys_cleanup **link;
    const sys_pcb *outer = dying; /* nested: a cleanup may end other threads */
    dying = p;
    while ((link = newest_of(p->pid)) != NULL) {
        const sys_cleanup *c = *link;
        *link = c->next;
        os_call_in_section(c->run, c->arg);
    }
    dying = outer;
    return previous_hook != NULL && previous_hook(p);
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
    if (!hook_installed) {
        hook_installed = true;
        previous_hook = os_thread_end_hook;
        os_thread_end_hook = on_thread_end;
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
