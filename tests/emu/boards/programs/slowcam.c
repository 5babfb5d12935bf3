/* The library's slow camera driver (epuck.md §7.3, §7.5) for the PO3030K: T1 counts the pixel clock, T4 HREF, T5 VSYNC;
   an interrupt per byte, every 64 Tcy. Interrupt-driven I2C writes the registers. Grey, 40 x 40, zoom 8, centred. */
#include <p30F6014A.h>
#include <stdint.h>

#define WIDTH 40
#define HEIGHT 40
#define ZOOM 2 /* software zoom in addition to the sensor's quarter size */

volatile uint8_t frame[WIDTH * HEIGHT];
volatile uint16_t id, row, column, done, skip;
static volatile uint8_t finished;

void __attribute__((interrupt, no_auto_psv)) _MI2CInterrupt(void)
{
    IFS0bits.MI2CIF = 0;
    finished = 1;
}

static void wait(void)
{
    uint16_t i;
    for (i = 0; i < 10000 && !finished; i++) {
    }
    finished = 0;
}

static void i2c_write(uint8_t reg, uint8_t value)
{
    I2CCONbits.SEN = 1;
    wait();
    I2CTRN = 0xDC;
    wait();
    I2CTRN = reg;
    wait();
    I2CTRN = value;
    wait();
    I2CCONbits.PEN = 1;
    wait();
}

static uint8_t i2c_read(uint8_t reg)
{
    uint8_t value;
    I2CCONbits.SEN = 1;
    wait();
    I2CTRN = 0xDC;
    wait();
    I2CTRN = reg;
    wait();
    I2CCONbits.RSEN = 1;
    wait();
    I2CTRN = 0xDD;
    wait();
    I2CCONbits.RCEN = 1;
    wait();
    value = (uint8_t)I2CRCV;
    I2CCONbits.ACKDT = 1;
    I2CCONbits.ACKEN = 1;
    wait();
    I2CCONbits.PEN = 1;
    wait();
    return value;
}

/* Byte interrupt: keeps every ZOOM-th byte. */
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void)
{
    IFS0bits.T1IF = 0;
    TMR1 = 0;
    if (skip == 0) {
        frame[row * WIDTH + column] = (uint8_t)(PORTD >> 8);
        skip = ZOOM;
        if (++column == WIDTH) {
            T1CONbits.TON = 0;
            row++;
            if (row == HEIGHT) {
                T4CONbits.TON = 0;
                done = 1;
            }
        }
    }
    skip--;
}

/* Row interrupt: reads the first byte itself, because T1 only counts from the second byte on. */
void __attribute__((interrupt, no_auto_psv)) _T4Interrupt(void)
{
    IFS1bits.T4IF = 0;
    TMR4 = 0;
    if (row < HEIGHT) {
        column = 0;
        skip = 0;
        TMR1 = 0;
        T1CONbits.TON = 1;
        IFS0bits.T1IF = 1;
    }
}

void __attribute__((interrupt, no_auto_psv)) _T5Interrupt(void)
{
    IFS1bits.T5IF = 0;
    T4CONbits.TON = 1;
    T5CONbits.TON = 0;
}

int main(void)
{
    static const uint8_t settings[][2] = {
        {0x1D, 0x50}, {0x20, 0x33}, {0x4E, 0x0C}, {0xD4, 0x1C},
        {0x08, 0x01}, {0x09, 0x6E}, {0x0A, 0x00}, {0x0B, 0x53}, {0x0C, 0x03}, {0x0D, 0x53}, {0x0E, 0x01}, {0x0F, 0xE8},
        {0xA5, 0x00}, {0xA6, 0x4F}, {0xA7, 0x01}, {0xA8, 0xE7}, {0xA9, 0x01}, {0xAA, 0x70},
    };
    uint16_t i;
    TRISCbits.TRISC13 = 0;
    LATCbits.LATC13 = 0;
    for (i = 0; i < 400; i++)
        __asm__ volatile("nop");
    LATCbits.LATC13 = 1;
    for (i = 0; i < 400; i++)
        __asm__ volatile("nop");
    I2CBRG = 150;
    I2CCON = 0;
    I2CCONbits.I2CEN = 1;
    IPC3bits.MI2CIP = 5;
    IEC0bits.MI2CIE = 1;
    id = (uint16_t)(i2c_read(0) << 8 | i2c_read(1));
    for (i = 0; i < sizeof settings / sizeof *settings; i++)
        i2c_write(settings[i][0], settings[i][1]);
    IPC0bits.T1IP = 6;
    IPC5bits.T4IP = 6;
    IPC5bits.T5IP = 6;
    T1CON = T4CON = T5CON = 0x0002;
    PR1 = 1;
    PR4 = ZOOM;
    TMR4 = ZOOM - 1;
    PR5 = 1;
    TMR5 = 0;
    IFS0bits.T1IF = 0;
    IFS1bits.T4IF = IFS1bits.T5IF = 0;
    IEC0bits.T1IE = 1;
    IEC1bits.T4IE = IEC1bits.T5IE = 1;
    T5CONbits.TON = 1;
    while (!done) {
    }
    return 0;
}
