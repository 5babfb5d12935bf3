/* SPDX-License-Identifier: MIT */
/* Cleanup functions that run when their thread ends, for whatever reason (openswarm_cleanup.h). */
#include "kernel.h"
#include "openswarm_cleanup.h"

static sys_cleanup *cleanups; /* of all threads, newest first; slice locked */
static sys_pcb *dying;        /* threads on no other list whose cleanups are still to run, in order of their end */
static sys_pcb *interrupted;  /* os_running of a handler in which cleanups run; NULL: none runs in a handler */

/* Returns the link to the newest cleanup of a thread, or NULL if it has none. */
BOUNDS_AT("for (", loop c);
static sys_cleanup **newest_of(const sys_pcb *thread)
{
    for (sys_cleanup **link = &cleanups; *link != NULL; link = &(*link)->next) {
        if ((*link)->thread == thread) {
            return link;
        }
    }
    return NULL;
}

/* Runs the cleanups of all dying threads, also of those that a cleanup ends, and frees the threads. */
BOUNDS_AT("while (dying", loop c + n, one);
/* A cleanup that ends the thread in which it runs leads here once more. */
RECURSION_BOUND(run_cleanups, 2);
static void run_all(void)
{
    bool in_kernel = os_in_kernel;
    if (in_kernel) {
        interrupted = os_running;
    } else {
        os_cleanup_host = os_running;
    }
    os_in_kernel = true;
    while (dying != NULL) {
        sys_pcb *p = dying;
        sys_cleanup **link = newest_of(p);
        if (link != NULL) {
            const sys_cleanup *c = *link;
            *link = c->next;
            HAL_STORE(os_running, p);
            os_call_in_section(c->run, c->arg);
        } else {
            dying = p->next;
            HAL_STORE(os_running, in_kernel ? interrupted : os_cleanup_host);
            process_free(p);
        }
    }
    os_in_kernel = in_kernel;
    os_cleanup_host = interrupted = NULL;
    if (os_cleanup_host_ends) {
        os_cleanup_host_ends = false;
        os_thread_returned();
    }
    os_preempt(); /* a cleanup woke a thread or sent a message */
}

/* Teardown of a thread. One loop runs all cleanups, so that cleanups that end threads do not nest. */
BOUNDS_AT("while (*end", loop n);
static void run_cleanups(sys_pcb *p)
{
    if (p == interrupted) {
        interrupted = &os_system;
    }
    if (newest_of(p) == NULL) {
        process_free(p);
    } else {
        sys_pcb **end = &dying;
        while (*end != NULL) {
            end = &(*end)->next;
        }
        p->next = NULL;
        *end = p;
    }
    if (dying != NULL && os_cleanup_host == NULL && interrupted == NULL) {
        run_all();
    }
}

BOUNDS_AT("for (", loop c);
bool Sys_Push_Cleanup(sys_cleanup *c, void (*run)(void *), void *arg)
{
    if (os_enter() != SYS_OK) {
        return false;
    }
    if (os_in_kernel) {
        return os_leave(os_refuse());
    }
    if (c == NULL || run == NULL) {
        return os_leave(SYS_ERROR_ARGUMENT);
    }
    for (const sys_cleanup *other = cleanups; other != NULL; other = other->next) {
        if (other == c) {
            return os_leave(SYS_ERROR_ARGUMENT);
        }
    }
    os_run_cleanups = run_cleanups;
    *c = (sys_cleanup){cleanups, run, arg, os_running};
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
    sys_cleanup **link = newest_of(os_running);
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
