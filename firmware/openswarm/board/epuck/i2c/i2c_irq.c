/* I2C master interrupt at IPL 4. */
#include "hal_i2c.h"
#include "kernel.h"

enum { PRIORITY = 4 };

HAL_USED void i2c_isr(void)
{
    IFS0bits.MI2CIF = 0;
    if (i2c_stepped()) {
        IEC0bits.MI2CIE = 0;
    }
}

void hal_i2c_start(void)
{
    i2c_init();
    IPC3bits.MI2CIP = PRIORITY;
}

void hal_i2c_begin(const i2c_transfer *transfer)
{
    i2c_begin(transfer);
    IEC0bits.MI2CIE = 1;
}

void hal_i2c_end(void)
{
    IEC0bits.MI2CIE = 0;
    __asm__ volatile("nop"); /* one more interrupt may slip in behind the write (isa.md §14.3) */
}
