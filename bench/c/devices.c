/* Firmware that uses one device all the time: built with -DLINE, -DTALK, -DWIRE, -DBUS or -DDUTY (bench/emulator/devices.py). */
#include <p30F6014A.h>
#include <stdint.h>
#include <stdio.h>

#include "dspic_compiler.h"

enum { BRG_115200 = 7 };

volatile uint16_t done;

#if defined(LINE) /* prints text on UART1 and polls for each byte */
int main(void)
{
    U1BRG = BRG_115200;
    U1MODEbits.UARTEN = 1;
    U1STAbits.UTXEN = 1;
    for (;;) {
        printf("t = %u ms, left %d, right %d, prox %u\n", done, (int)done - 40, 40 - (int)done, done & 0xFFF);
        done++;
    }
}

#elif defined(TALK) /* echoes the input of UART2; interrupts in both directions */
static volatile uint8_t ring[64];
static volatile uint16_t head, tail;

static void send(void)
{
    while (tail != head && !U2STAbits.UTXBF) {
        U2TXREG = ring[tail++ & 63];
        done++;
    }
}

OS_ISR(_U2RXInterrupt)
{
    IFS1bits.U2RXIF = 0;
    while (U2STAbits.URXDA) {
        ring[head++ & 63] = (uint8_t)U2RXREG;
    }
    send();
}

OS_ISR(_U2TXInterrupt)
{
    IFS1bits.U2TXIF = 0;
    send();
}

int main(void)
{
    U2BRG = BRG_115200;
    U2MODEbits.UARTEN = 1;
    IEC1bits.U2RXIE = IEC1bits.U2TXIE = 1;
    U2STAbits.UTXEN = 1;
    for (;;) {
    }
}

#elif defined(WIRE) /* sends 16-bit words over SPI1 at 1/4 Tcy and polls for each word */
int main(void)
{
    uint16_t sum = 0;
    SPI1CON = 0x053E; /* MODE16, CKE, MSTEN, primary 4, secondary 1 */
    SPI1STATbits.SPIEN = 1;
    for (;;) {
        SPI1BUF = sum;
        while (!SPI1STATbits.SPIRBF) {
        }
        sum += SPI1BUF;
        done++;
    }
}

#elif defined(BUS) /* reads a camera register over I2C at 100 kHz, polls every flag */
static void idle(void)
{
    while (I2CCON & 0x1F) {
    }
}

static void send(uint8_t byte)
{
    I2CTRN = byte;
    while (I2CSTATbits.TRSTAT) {
    }
}

int main(void)
{
    I2CBRG = 146;
    I2CCONbits.I2CEN = 1;
    for (;;) {
        I2CCONbits.SEN = 1;
        idle();
        send(0xDC);
        send(0x03);
        I2CCONbits.PEN = 1;
        idle();
        I2CCONbits.SEN = 1;
        idle();
        send(0xDD);
        I2CCONbits.RCEN = 1;
        idle();
        while (!I2CSTATbits.RBF) {
        }
        done += I2CRCV;
        I2CCONbits.ACKDT = 1;
        I2CCONbits.ACKEN = 1;
        idle();
        I2CCONbits.PEN = 1;
        idle();
    }
}

#elif defined(DUTY) /* PWM of 20 kHz on OC1; the timer's interrupt sets a new duty cycle in every period */
OS_ISR(_T2Interrupt)
{
    IFS0bits.T2IF = 0;
    OC1RS = done++ % 700;
}

int main(void)
{
    PR2 = 736;
    OC1RS = 100;
    OC1CON = 6;
    IEC0bits.T2IE = 1;
    T2CONbits.TON = 1;
    for (;;) {
    }
}
#endif
