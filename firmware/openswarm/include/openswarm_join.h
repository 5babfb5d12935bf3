/* SPDX-License-Identifier: MIT */
/* Waiting for the end of a thread; linked where it is used. Contract lines: openswarm.h. */
#ifndef OPENSWARM_JOIN_H
#define OPENSWARM_JOIN_H

#include "openswarm.h"

/* MTH | no | 62 more than Sys_Start_ProcessWith | 52 | as that.  Whatever ends the thread, it then stays in state SYS_ZOMBIE, with its
 * PID and 18 bytes of the heap, until Sys_Join has returned for it; if somebody is waiting there already, it is gone at
 * once. Sys_Kill_Process of a zombie takes it away too, and tells its termination again. */
uint16 Sys_Start_Joinable(const sys_process_config *config);
/* T | until the thread has ended | 786 for a zombie beside the events of the system; 271 to the next thread if it blocks | 58 | CONTEXT, PROCESS: there is none of this PID, it is the caller's or the
 * system's.  Of any living thread, and of zombies. Several may wait for the same. */
bool Sys_Join(uint16 pid);

#endif
