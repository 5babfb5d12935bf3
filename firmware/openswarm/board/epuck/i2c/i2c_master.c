/* SPDX-License-Identifier: MIT */
/* I2C master (dspic30f6014a.md §11): one step per MI2CIF. */
#include "i2c_master.h"

#include "hal_compiler.h"
#include "pins.h"

enum {
    BAUD = 150,       /* 151 Tcy a bit, 97.6 kHz, as the robot's library (dspic30f6014a.md §11) */
    ENABLE = 0x8000,  /* I2CCON: I2CEN */
    RELEASE = 0x1000, /* SCLREL: do not stretch */
    START = 0x0001,
    RESTART = 0x0002,
    STOP = 0x0004,
    RECEIVE = 0x0008,
    ACKNOWLEDGE = 0x0010,
    REFUSE = 0x0020, /* ACKDT: no acknowledge */
    NOT_ACKNOWLEDGED = 0x8000, /* I2CSTAT */
    COLLISION = 0x0400,
    READ = 1,
    PIN_SCL = 0x0004, /* RG2 */
    PIN_SDA = 0x0008, /* RG3 */
    HALF_BIT_LOOPS = 20, /* a half bit lasts over 75 Tcy */
    CLOCKS = 9,       /* a slave releases SDA after at most a byte and its acknowledge */
    PATIENCE = 20000  /* polls of some 15 Tcy: 20 ms; one byte takes 0.2 ms */
};

typedef enum { ADDRESS, OUT, ADDRESS_TO_READ, RESTARTED, IN, IN_ACKNOWLEDGED, STOPPED } step;

static const i2c_transfer *transfer;
static step at;
static uint8_t position;
static i2c_result outcome;

/* ---- Bit-banged lines ------------------------------------------------------------------------------------------ */

static void half_bit(void)
{
    for (uint8_t i = 0; i < HALF_BIT_LOOPS; i++) {
        __asm__ volatile("nop");
    }
}

bool i2c_bus_is_free(void)
{
    return (PORTG & PIN_I2C) == PIN_I2C;
}

bool i2c_recover(void)
{
    I2CCON = 0;
    LATG &= (uint16_t)~PIN_I2C;
    TRISG |= PIN_I2C; /* open drain: a line is low as an output and high as an input */
    half_bit();
    for (uint8_t i = 0; i < CLOCKS && !(PORTG & PIN_SDA); i++) {
        TRISG &= (uint16_t)~PIN_SCL;
        half_bit();
        TRISG |= PIN_SCL;
        half_bit();
    }
    TRISG &= (uint16_t)~PIN_SCL; /* a stop: SDA rises while SCL is high */
    half_bit();
    TRISG &= (uint16_t)~PIN_SDA;
    half_bit();
    TRISG |= PIN_SCL;
    half_bit();
    TRISG |= PIN_SDA;
    half_bit();
    bool free = i2c_bus_is_free();
    I2CBRG = BAUD;
    I2CCON = ENABLE | RELEASE;
    I2CSTAT = 0; /* clears collision and overflow */
    IFS0bits.MI2CIF = 0;
    return free;
}

void i2c_init(void)
{
    (void)i2c_recover();
}

/* ---- One transfer ---------------------------------------------------------------------------------------------- */

static void request(uint16_t action)
{
    I2CCON = (uint16_t)(ENABLE | RELEASE | action);
}

static i2c_result stop(i2c_result result)
{
    outcome = result;
    at = STOPPED;
    request(STOP);
    return I2C_BUSY;
}

void i2c_begin(const i2c_transfer *wanted)
{
    transfer = wanted;
    position = 0;
    at = ADDRESS;
    IFS0bits.MI2CIF = 0;
    request(START);
}

static i2c_result send_next(void)
{
    if (position < transfer->out_size) {
        at = OUT;
        I2CTRN = transfer->out[position++];
    } else if (transfer->in_size != 0) {
        at = ADDRESS_TO_READ;
        request(RESTART);
    } else {
        return stop(I2C_DONE);
    }
    return I2C_BUSY;
}

static i2c_result receive_next(void)
{
    at = IN;
    request(RECEIVE);
    return I2C_BUSY;
}

i2c_result i2c_advance(void)
{
    uint16_t status = I2CSTAT;
    if (status & COLLISION) {
        I2CSTAT = 0;
        return I2C_COLLISION;
    }
    switch (at) {
    case ADDRESS:
        if (transfer->out_size == 0) {
            at = RESTARTED;
            I2CTRN = (uint16_t)(transfer->address << 1 | READ);
        } else {
            at = OUT;
            I2CTRN = (uint16_t)(transfer->address << 1);
        }
        return I2C_BUSY;
    case OUT:
        return status & NOT_ACKNOWLEDGED ? stop(I2C_NO_ACK) : send_next();
    case ADDRESS_TO_READ:
        at = RESTARTED;
        position = 0;
        I2CTRN = (uint16_t)(transfer->address << 1 | READ);
        return I2C_BUSY;
    case RESTARTED:
        return status & NOT_ACKNOWLEDGED ? stop(I2C_NO_ACK) : receive_next();
    case IN:
        transfer->in[position++] = (uint8_t)I2CRCV;
        at = IN_ACKNOWLEDGED;
        request((uint16_t)(ACKNOWLEDGE | (position == transfer->in_size ? REFUSE : 0)));
        return I2C_BUSY;
    case IN_ACKNOWLEDGED:
        return position < transfer->in_size ? receive_next() : stop(I2C_DONE);
    default:
        return outcome;
    }
}

/* Steps: start, two addresses, restart, stop, and two for each byte. */
BOUNDS_AT("while (result == I2C_BUSY)", loop 5 + 2 * w);
BOUNDS_AT("while (!IFS0bits.MI2CIF)", loop 20000);
static i2c_result poll(const i2c_transfer *wanted)
{
    i2c_result result = I2C_BUSY;
    i2c_begin(wanted);
    while (result == I2C_BUSY) {
        uint16_t patience = PATIENCE;
        while (!IFS0bits.MI2CIF) {
            if (--patience == 0) {
                return I2C_TIMEOUT;
            }
        }
        IFS0bits.MI2CIF = 0;
        result = i2c_advance();
    }
    return result;
}

i2c_result i2c_transfer_polled(const i2c_transfer *wanted)
{
    if (!i2c_bus_is_free() && !i2c_recover()) {
        return I2C_STUCK;
    }
    i2c_result result = poll(wanted);
    if (result != I2C_DONE && result != I2C_NO_ACK && !i2c_recover()) {
        return I2C_STUCK;
    }
    return result;
}
