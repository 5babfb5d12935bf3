/* The library's fast camera driver for PO6030K: 160 x 160 centred, zoom 8, RGB565 (epuck.md §7.5, openswarm-original.md
   §5.5). The line handler is in lines.s. Ends when the frame is complete. */
#include "i2c.h"

#define WIDTH 20
#define HEIGHT 20
#define SKIPPED_LINES 1

volatile uint8_t frame[WIDTH * HEIGHT * 2];
uint8_t pattern[WIDTH * 4 + 1]; /* action per bus byte: 1 store, 0 skip, 2 end of line */
volatile uint8_t *volatile cursor = frame;
volatile uint16_t lines_left = HEIGHT;
volatile uint16_t id;
volatile uint16_t frames = 1;

void __attribute__((interrupt, no_auto_psv)) _T5Interrupt(void)
{
    IFS1bits.T5IF = 0;
    T4CONbits.TON = 1;
    T5CONbits.TON = 0;
}

static void bank_write(uint8_t bank, uint8_t reg, uint8_t value)
{
    i2c_write_register(0xDC, 0x03, bank);
    i2c_write_register(0xDC, reg, value);
}

static void configure(void)
{
    bank_write(1, 0x51, 62);
    bank_write(1, 0x50, 0);
    bank_write(1, 0x60, 0);
    bank_write(1, 0x61, 164);
    bank_write(1, 0x62, 488 >> 8);
    bank_write(1, 0x63, 488 & 0xFF);
    bank_write(0, 0x91, 0x50);
    bank_write(1, 0x38, 0x08);
    bank_write(1, 0x68, 3);
    bank_write(1, 0x80, 0x80);
    bank_write(1, 0x81, 0x80);
    bank_write(1, 0x82, 1);
    bank_write(0, 0x90, 0xC0);
}

static void capture(void)
{
    cursor = frame;
    lines_left = HEIGHT;
    TMR5 = 0;
    PR5 = 1;
    T5CON = 0x0002;
    TMR4 = SKIPPED_LINES;
    PR4 = SKIPPED_LINES + 1;
    T4CON = 0x0002;
    IFS1bits.T4IF = 0;
    IFS1bits.T5IF = 0;
    IEC1bits.T4IE = 1;
    IEC1bits.T5IE = 1;
    T5CONbits.TON = 1;
    while (lines_left != 0) {
    }
}

int main(void)
{
    LATCbits.LATC13 = 0;
    TRISCbits.TRISC13 = 0;
    for (volatile int i = 0; i < 100; i++) {
    }
    LATCbits.LATC13 = 1;
    for (volatile int i = 0; i < 100; i++) {
    }
    i2c_init();
    id = i2c_read_register(0xDC, 0) << 8 | i2c_read_register(0xDC, 1);
    IPC5bits.T4IP = 6;
    IPC5bits.T5IP = 6;
    configure();
    for (int i = 0; i < WIDTH; i++) {
        pattern[4 * i] = pattern[4 * i + 1] = 1;
        pattern[4 * i + 2] = pattern[4 * i + 3] = 0;
    }
    pattern[4 * WIDTH] = 2;
    for (uint16_t i = 0; i < frames; i++)
        capture();
    return 0;
}
