/* SPDX-License-Identifier: MIT */
/* How to write a scheduler: one function that picks from the ring of ready threads. */
#ifndef OPENSWARM_SCHEDULER_H
#define OPENSWARM_SCHEDULER_H

#include "openswarm.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sys_pcb sys_pcb;

/* Kernel stack, slice locked. first is the ready thread whose turn it is by round robin; the ring through Sys_Next_Ready
 * comes back to it. Returns the thread to run, which must be on the ring. */
typedef sys_pcb *(*sys_pick)(sys_pcb *first);

struct sys_scheduler {
    sys_pick pick; /* NULL = round robin */
    bool eager; /* asked also when something becomes due within a slice. Who was running is first then, and keeps the
                 * rest of its slice if it is not picked */
};

sys_pcb *Sys_Next_Ready(const sys_pcb *process);
uint16 Sys_Pid_Of(const sys_pcb *process);
uint8 Sys_Priority_Of(const sys_pcb *process);

#ifdef __cplusplus
}
#endif

#endif
