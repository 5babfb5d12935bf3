/* SPDX-License-Identifier: MIT */
/* I2C master of the e-puck, stepped by its interrupt flag; independent of the kernel. RG3 is SDA, RG2 is SCL
 * (epuck.md §2). */
#ifndef I2C_MASTER_H
#define I2C_MASTER_H

#include <stdbool.h>
#include <stdint.h>

typedef enum {
    I2C_DONE,
    I2C_BUSY,      /* transfer in progress */
    I2C_NO_ACK,    /* no slave has this address, or the byte was refused */
    I2C_COLLISION, /* another master held the bus */
    I2C_TIMEOUT,   /* the clock was stretched for too long */
    I2C_STUCK      /* SDA or SCL stays low, also after recovery */
} i2c_result;

/* Writes `out`, then reads `in` behind a repeated start; either may be empty. */
typedef struct {
    uint8_t address; /* 7 bits */
    uint8_t out_size, in_size;
    const uint8_t *out;
    uint8_t *in;
} i2c_transfer;

void i2c_init(void);                         /* pins and module; frees a stuck bus */
bool i2c_bus_is_free(void);                  /* both lines are high */
bool i2c_recover(void);                      /* clocks a slave that holds SDA until it releases it; false: still stuck */
void i2c_begin(const i2c_transfer *transfer); /* requires a free bus */
i2c_result i2c_advance(void);                /* after each MI2CIF: the next step */

/* A whole transfer by polling: while no interrupt is enabled, or without a kernel. Recovers the bus before and after a
 * failure. At most I2C_PATIENCE polls for one step, some 20 ms for a byte that a slave stretches. */
i2c_result i2c_transfer_polled(const i2c_transfer *transfer);

#endif
