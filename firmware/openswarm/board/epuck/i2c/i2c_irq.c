/* SPDX-License-Identifier: MIT */
/* I2C master interrupt at IPL 4. */
#include "hal_i2c.h"
#include "openswarm_interrupt.h"

static void step_done(void)
{
    if (i2c_stepped()) {
        Sys_Disable_Interrupt(MI2C);
    }
}
SYS_INTERRUPT(MI2C, 4, step_done)

void hal_i2c_start(void)
{
    i2c_init();
}

void hal_i2c_begin(const i2c_transfer *transfer)
{
    i2c_begin(transfer);
    Sys_Enable_Interrupt(MI2C);
}

void hal_i2c_end(void)
{
    Sys_Disable_Interrupt(MI2C);
    __asm__ volatile("nop"); /* one more interrupt may be taken after the write (isa.md §14.3) */
}
