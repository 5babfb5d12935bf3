/* SPDX-License-Identifier: MIT */
/* Interface of the POSIX port for tests, benchmarks and the host board, besides the HAL.
 *
 * Time is real or virtual. Real: a 1 ms interval timer raises SIGALRM. Virtual (host_use_virtual_time): the clock
 * advances 1 ms each time the kernel idles and at host_tick(); a slice ends at host_slice(). Virtual runs are
 * deterministic. */
#ifndef HOST_H
#define HOST_H

#include <stdbool.h>
#include <stdint.h>

void host_use_virtual_time(void);           /* before Sys_Start_Kernel */
void host_at_idle(void (*hook)(uint32_t));  /* on the kernel stack, before each idle; argument: idles so far */

/* Interrupts, from any context; taken at once or when the level allows. */
void host_tick(void);                        /* 1 ms clock */
void host_slice(void);                       /* end of slice */
void host_device(void (*isr)(void));         /* isr at device level; up to 8 wait */

/* Calls hook when the n-th unlock from now has just restored its level (1 = the next one). 0 = never. */
void host_at_unlock(unsigned long n, void (*hook)(void));
unsigned long host_unlocks(void); /* number of unlocks so far */

/* Makes the n-th allocation from now fail (1 = the next one); 0 = none. */
void host_fail_allocation(unsigned long n);
unsigned long host_allocations(void); /* number of requested allocations so far */

#endif
