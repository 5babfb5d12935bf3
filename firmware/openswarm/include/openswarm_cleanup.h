/* SPDX-License-Identifier: MIT */
/* Cleanup functions, called when a thread ends: it returns, is killed, or hits its stack limit. Linked only where used.
 * Contract lines: openswarm.h.
 *
 *     sys_cleanup off;
 *     Sys_Push_Cleanup(&off, all_lamps_off, NULL);
 *     ...
 *     Sys_Pop_Cleanup(true); */
#ifndef OPENSWARM_CLEANUP_H
#define OPENSWARM_CLEANUP_H

#include "openswarm.h"

/* Private to the kernel. The object must exist until it is popped or the thread ends: on the stack of a function
 * that pops it before it returns, or in static memory. */
typedef struct sys_cleanup {
    struct sys_cleanup *next;
    void (*run)(void *arg);
    void *arg;
    uint16 pid;
} sys_cleanup;

/* T | no | 99; 108 beside two of others | 28 | CONTEXT, ARGUMENT: the object is pushed already.  Makes the kernel
 * call run(arg) when the calling thread ends, the newest cleanup first. It runs as in a critical section, on the
 * stack of the context that ends the thread. The thread's memory still exists, its subscriptions and mutexes do not.
 * SYS_EVENT_TERMINATION follows. */
bool Sys_Push_Cleanup(sys_cleanup *cleanup, void (*run)(void *arg), void *arg);
/* T | no | 101, 9 more per newer one of others, 54 and those of run if it is called | 24 and run's | CONTEXT,
 * PROCESS: the caller has none.  Removes the caller's newest cleanup; run: also calls it. */
bool Sys_Pop_Cleanup(bool run);

#endif
