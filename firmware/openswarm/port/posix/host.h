/* SPDX-License-Identifier: MIT */
/* What the POSIX port offers to tests, benches and the host board, beside the HAL.
 *
 * Two kinds of time. Real: a 1 ms interval timer raises SIGALRM. Virtual (host_use_virtual_time): the clock moves 1 ms
 * each time the kernel idles and when host_tick() is called; a slice ends when host_slice() is called. Every run is
 * then the same. */
#ifndef HOST_H
#define HOST_H

#include <stdbool.h>
#include <stdint.h>

void host_use_virtual_time(void);           /* before Sys_Start_Kernel */
void host_at_idle(void (*hook)(uint32_t));  /* kernel stack, before each idle; argument: how many so far */

/* Interrupts, from any context; taken at once or when the level allows. */
void host_tick(void);                        /* 1 ms clock */
void host_slice(void);                       /* end of slice */
void host_device(void (*isr)(void));         /* isr at device level; up to 8 wait */

/* Calls hook when the n-th unlock from now has just restored its level (1 = the next one). 0 = never. */
void host_at_unlock(unsigned long n, void (*hook)(void));
unsigned long host_unlocks(void); /* so far */

/* Makes the n-th allocation from now fail (1 = the next one); 0 = none. */
void host_fail_allocation(unsigned long n);
unsigned long host_allocations(void); /* asked for so far */

#endif
