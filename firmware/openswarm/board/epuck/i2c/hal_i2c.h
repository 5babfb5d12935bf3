/* SPDX-License-Identifier: MIT */
/* Interrupt of the I2C master. */
#ifndef HAL_I2C_H
#define HAL_I2C_H

#include "i2c_master.h"

void hal_i2c_start(void);
void hal_i2c_begin(const i2c_transfer *transfer); /* i2c_stepped() is called after each step */
void hal_i2c_end(void);                           /* disables the interrupt */
bool i2c_stepped(void);                           /* ISR, io/i2c; true: the transfer is over */

#endif
