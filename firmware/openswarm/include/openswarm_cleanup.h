/* SPDX-License-Identifier: MIT */
/* What is to be done when a thread ends, whatever ends it: it returns, is killed by anybody, or hits its stack limit. Linked where
 * it is used. Contract lines: openswarm.h.
 *
 *     sys_cleanup off;
 *     Sys_Push_Cleanup(&off, all_lamps_off, NULL);
 *     ...
 *     Sys_Pop_Cleanup(true); */
#ifndef OPENSWARM_CLEANUP_H
#define OPENSWARM_CLEANUP_H

#include "openswarm.h"

/* The kernel's. It stays until it is popped or the thread ends: on the stack of a function that pops it before it returns,
 * or in static memory. */
typedef struct sys_cleanup {
    struct sys_cleanup *next;
    void (*run)(void *arg);
    void *arg;
    uint16 pid;
} sys_cleanup;

/* T | no | 99; 108 beside two of others | 28 | CONTEXT, ARGUMENT: it is pushed already.  run(arg) will be called when the calling thread ends, the newest first: with switches locked out,
 * as in a critical section, on the stack of whoever ends the thread. Its memory is still there, its subscriptions and mutexes
 * are not. SYS_EVENT_TERMINATION follows. */
bool Sys_Push_Cleanup(sys_cleanup *cleanup, void (*run)(void *arg), void *arg);
/* T | no | 101, 9 more per newer one of others, 54 and what run takes if it is called | 24 and run's | CONTEXT, PROCESS: there is none.  Takes the caller's newest away, and runs it if asked to. */
bool Sys_Pop_Cleanup(bool run);

#endif
