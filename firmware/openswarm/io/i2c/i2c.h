/* SPDX-License-Identifier: MIT */
/* I2C for threads: the interrupt does the transfer, the thread sleeps. */
#ifndef I2C_H
#define I2C_H

#include "i2c_master.h"
#include "openswarm.h"

enum { SYS_I2C_TIMEOUT_MS = 25 };

/* M | no | - | 30.  Between Sys_Init_Kernel and Sys_Start_Kernel; drivers that poll the bus run before or after it. */
void Sys_Start_I2C(void);

/* T | until done, at most SYS_I2C_TIMEOUT_MS and 4 ms of recovery | - | 64 | CONTEXT, BUSY, MEMORY.  I2C_DONE, or why not:
 * after a time-out or collision the bus has been recovered. I2C_BUSY: refused, and the last error says why: BUSY = another
 * thread's transfer is on its way. The bytes travel in a block of the heap, sizeof(i2c_transfer) + out_size + in_size; that
 * of a thread killed meanwhile is kept until the next call, which also recovers the bus. */
i2c_result Sys_I2C_Transfer(const i2c_transfer *transfer);

#endif
