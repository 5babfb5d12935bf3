/* SPDX-License-Identifier: MIT */
/* I2C: one transfer at a time. The interrupt steps it on the bus's own block; a time-out guards it. */
#include "i2c.h"

#include "bus.h"
#include "hal_i2c.h"
#include "kernel.h"

#include <string.h>

typedef struct {
    i2c_transfer transfer;
    uint8 bytes[]; /* out, then in */
} job;

static bus i2c;
static volatile uint8 result; /* an i2c_result; I2C_BUSY during a transfer, and until the lines are known to be idle */

bool i2c_stepped(void)
{
    result = (uint8)i2c_advance();
    return result != I2C_BUSY;
}

static bool recover(void)
{
    result = I2C_BUSY; /* remains so if the thread is killed half-way */
    bool free = i2c_recover();
    result = I2C_DONE;
    return free;
}

static i2c_result transfer_now(const i2c_transfer *transfer)
{
    bool rests = (result == I2C_DONE || result == I2C_NO_ACK) && i2c_bus_is_free();
    if (!rests && !recover()) {
        return I2C_STUCK;
    }
    result = I2C_BUSY;
    hal_i2c_begin(transfer);
    for (uint8 ms = 0; result == I2C_BUSY && ms < SYS_I2C_TIMEOUT_MS; ms++) {
        Sys_Sleep(1);
    }
    hal_i2c_end();
    i2c_result seen = result == I2C_BUSY ? I2C_TIMEOUT : (i2c_result)result;
    if ((seen == I2C_TIMEOUT || seen == I2C_COLLISION) && !recover()) {
        seen = I2C_STUCK;
    }
    return seen;
}

i2c_result Sys_I2C_Transfer(const i2c_transfer *wanted)
{
    job *j = bus_take(&i2c, (uint16)(sizeof *j + wanted->out_size + wanted->in_size), hal_i2c_end);
    if (j == NULL) {
        return I2C_BUSY;
    }
    j->transfer = *wanted;
    j->transfer.out = j->bytes;
    j->transfer.in = j->bytes + wanted->out_size;
    memcpy(j->bytes, wanted->out, wanted->out_size);
    i2c_result seen = transfer_now(&j->transfer);
    if (seen == I2C_DONE) {
        memcpy(wanted->in, j->transfer.in, wanted->in_size);
    }
    bus_give(&i2c, hal_i2c_end);
    return seen;
}

void Sys_Start_I2C(void)
{
    hal_i2c_start();
}
