/* SPDX-License-Identifier: MIT */
/* I2C for threads: the interrupt performs the transfer while the thread sleeps. */
#ifndef I2C_H
#define I2C_H

#include "i2c_master.h"
#include "openswarm.h"

enum { SYS_I2C_TIMEOUT_MS = 25 };

/* M | no | - | 30 | none.  Between Sys_Init_Kernel and Sys_Start_Kernel; drivers that poll the bus run before or after it. */
void Sys_Start_I2C(void);

/* T | until done, at most SYS_I2C_TIMEOUT_MS and 4 ms of recovery | - | 64 | CONTEXT, BUSY, MEMORY.  Returns
 * I2C_DONE or the cause of a failure; after a time-out or collision the bus has been recovered. I2C_BUSY: refused,
 * see the last error; BUSY = another thread's transfer is in progress. The bytes are copied to a heap block of
 * sizeof(i2c_transfer) + out_size + in_size bytes. The block of a thread killed meanwhile is kept until the next
 * call, which also recovers the bus. */
i2c_result Sys_I2C_Transfer(const i2c_transfer *transfer);

#endif
