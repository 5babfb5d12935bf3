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
    struct sys_pcb *thread;
} sys_cleanup;

/* MT | no | 94; 106 beside two of others | 28 | CONTEXT, ARGUMENT: NULL, or the object is pushed already.  Makes the
 * kernel call run(arg) when the calling thread ends, the newest cleanup first. SYS_EVENT_TERMINATION follows.
 *
 * Teardown has a fixed order. First the thread leaves every list of the kernel: it owns no subscription, message,
 * mutex, join or service, and no call finds its PID. Then its cleanups run. Its memory exists until the last one has
 * returned.
 *
 * A cleanup may call what a handler may call (H). Sys_Get_ProcessID returns the PID of the ending thread. The cleanup
 * runs as in a critical section, on the stack of the context that ends the thread. If a cleanup ends other threads,
 * their cleanups follow those of this thread. If it ends the thread on whose stack it runs, that thread ends last. */
bool Sys_Push_Cleanup(sys_cleanup *cleanup, void (*run)(void *arg), void *arg);
/* MT | no | 99, 9 more per newer one of others, 54 and those of run if it is called | 24 and run's | CONTEXT,
 * PROCESS: the caller has none.  Removes the caller's newest cleanup; run: also calls it. */
bool Sys_Pop_Cleanup(bool run);

#endif
