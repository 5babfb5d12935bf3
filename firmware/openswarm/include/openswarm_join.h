/* SPDX-License-Identifier: MIT */
/* Joining threads (waiting for their end). Linked only where used. Contract lines: openswarm.h. */
#ifndef OPENSWARM_JOIN_H
#define OPENSWARM_JOIN_H

#include "openswarm.h"

/* MTH | no | 27 more than Sys_Start_ProcessWith | 52 | as that.  Starts a joinable thread. After its end it stays in
 * state SYS_ZOMBIE, with its PID and 18 bytes of the heap, until Sys_Join returns for it; if a thread already joins
 * it, it disappears at once. Sys_Kill_Process also removes a zombie, and sends its SYS_EVENT_TERMINATION again. */
uint16 Sys_Start_Joinable(const sys_process_config *config);
/* T | until the thread has ended | 796 for a zombie beside the events of the system; 245 to the next thread if it
 * blocks | 60 | CONTEXT, PROCESS: no such thread, or it is the system thread, the caller, or joins the caller,
 * directly or through others.  Waits for the end of any thread, or removes a zombie. Several threads may join the
 * same thread. */
bool Sys_Join(uint16 pid);
/* The same; false with SYS_OK also after ms milliseconds. ms 0 = no time-out. */
bool Sys_JoinTimeout(uint16 pid, uint16 ms);

#endif
