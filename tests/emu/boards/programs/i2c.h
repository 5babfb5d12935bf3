/* Polled I2C master like the vendor library's: every step polls MI2CIF, with a time-out (dspic30f6014a.md §11). */
#ifndef I2C_H
#define I2C_H
#include <p30F6014A.h>
#include <stdint.h>

static int i2c_wait(void)
{
    for (uint16_t i = 0; i < 10000; i++)
        if (IFS0bits.MI2CIF) {
            IFS0bits.MI2CIF = 0;
            return 1;
        }
    return 0;
}

static void i2c_init(void)
{
    I2CBRG = 150;
    I2CCON = 0;
    I2CCONbits.I2CEN = 1;
    IFS0bits.MI2CIF = 0;
}

static int i2c_start(void)
{
    I2CCONbits.SEN = 1;
    return i2c_wait();
}

static int i2c_restart(void)
{
    I2CCONbits.RSEN = 1;
    return i2c_wait();
}

static int i2c_stop(void)
{
    I2CCONbits.PEN = 1;
    return i2c_wait();
}

/* Returns true if the byte was acknowledged. */
static int i2c_send(uint8_t byte)
{
    I2CTRN = byte;
    return i2c_wait() && !I2CSTATbits.ACKSTAT;
}

static uint8_t i2c_receive_last(void)
{
    I2CCONbits.RCEN = 1;
    i2c_wait();
    uint8_t byte = (uint8_t)I2CRCV;
    I2CCONbits.ACKDT = 1;
    I2CCONbits.ACKEN = 1;
    i2c_wait();
    return byte;
}

static inline int i2c_write_register(uint8_t device, uint8_t reg, uint8_t value)
{
    int acknowledged = i2c_start() & i2c_send(device);
    acknowledged &= i2c_send(reg);
    acknowledged &= i2c_send(value);
    i2c_stop();
    return acknowledged;
}

/* The library does not check ACKSTAT, so an absent device reads 0xFF (epuck.md §2). */
static uint8_t i2c_read_register(uint8_t device, uint8_t reg)
{
    i2c_start();
    i2c_send(device);
    i2c_send(reg);
    i2c_restart();
    i2c_send(device | 1);
    uint8_t value = i2c_receive_last();
    i2c_stop();
    return value;
}
#endif
