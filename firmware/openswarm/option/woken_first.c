/* SPDX-License-Identifier: MIT */
/* The scheduler sys_woken_first: round robin, but woken threads run before the others. In a file of its own, so that it
 * is linked only where it is used. */
#include "kernel.h"

/* Returns the first thread of the ring that was woken and has not run since, else the first thread. */
BOUNDS_AT("while (p != first)", loop n);
static sys_pcb *first_woken(sys_pcb *first)
{
    sys_pcb *p = first;
    do {
        if (p->status & OS_WOKEN) {
            p->status &= (uint8)~OS_WOKEN;
            return p;
        }
        p = p->next;
    } while (p != first);
    return first;
}

const sys_scheduler sys_woken_first = {first_woken, true};
