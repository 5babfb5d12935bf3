/* SPDX-License-Identifier: MIT */
/* Round robin, but who has waited runs before all who have not. A file of its own: linked where it is used. */
#include "kernel.h"

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
