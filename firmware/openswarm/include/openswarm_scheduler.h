/* SPDX-License-Identifier: MIT */
/* Interface of schedulers: one function that picks from the ring of ready threads. */
#ifndef OPENSWARM_SCHEDULER_H
#define OPENSWARM_SCHEDULER_H

#include "openswarm.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sys_pcb sys_pcb;

/* Returns the thread to run, which must be on the ring. first is the next ready thread by round robin; Sys_Next_Ready
 * iterates over the ring back to it. Kernel stack, slice locked. */
typedef sys_pcb *(*sys_pick)(sys_pcb *first);

struct sys_scheduler {
    sys_pick pick; /* NULL = round robin, which is never eager */
    bool eager; /* pick is also called within a slice when a thread wakes or a message arrives; first is then the
                 * running thread, which keeps the rest of its slice if it is not picked */
};

/* H | no | 5 | 4 | none.  Only while a sys_pick runs. */
sys_pcb *Sys_Next_Ready(const sys_pcb *process);
uint16 Sys_Pid_Of(const sys_pcb *process);
uint8 Sys_Priority_Of(const sys_pcb *process);

#ifdef __cplusplus
}
#endif

#endif
