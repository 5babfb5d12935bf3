/* Sound as in the vendor library (epuck.md §6, dspic30f6014a.md §14): releases the codec from reset, sends control
   words in secondary frames, then sends four samples from constant memory at every DCI interrupt. */
#include <p30F6014A.h>
#include <stdint.h>

#define SAMPLES 64
static const int16_t wave[SAMPLES] = {0,     3212,  6393,  9512,  12539, 15446, 18204, 20787, 23170, 25329, 27245,
                                      28898, 30273, 31356, 32137, 32609, 32767, 32609, 32137, 31356, 30273, 28898,
                                      27245, 25329, 23170, 20787, 18204, 15446, 12539, 9512,  6393,  3212};
static const uint8_t settings[6][2] = {{3, 0x00}, {4, 0x13}, {1, 0x18}, {2, 0x00}, {6, 0xB3}, {7, 0x5F}};
volatile uint16_t blocks, at, setting;

void __attribute__((interrupt, no_auto_psv)) _DCIInterrupt(void)
{
    volatile uint16_t unused;
    IFS2bits.DCIIF = 0;
    unused = RXBUF0;
    unused = RXBUF1;
    unused = RXBUF2;
    unused = RXBUF3;
    (void)unused;
    if (setting < 6) { /* a primary word that requests a secondary frame, then the control word */
        TXBUF0 = 0x7FFF;
        TXBUF1 = (uint16_t)(settings[setting][0] << 8 | settings[setting][1]);
        TXBUF2 = 0;
        TXBUF3 = 0;
        setting++;
    } else {
        TXBUF0 = (uint16_t)wave[at] & 0xFFFE;
        TXBUF1 = (uint16_t)wave[at + 1] & 0xFFFE;
        TXBUF2 = (uint16_t)wave[at + 2] & 0xFFFE;
        TXBUF3 = (uint16_t)wave[at + 3] & 0xFFFE;
        at = (at + 4) % SAMPLES;
    }
    blocks++;
}

int main(void)
{
    uint16_t i;
    TRISFbits.TRISF0 = 0;
    LATFbits.LATF0 = 0;
    for (i = 0; i < 200; i++)
        __asm__ volatile("nop");
    LATFbits.LATF0 = 1;
    DCICON1 = 0x0040;
    DCICON2 = 0x0DEF;
    DCICON3 = 3;
    TSCON = 1;
    RSCON = 1;
    TXBUF0 = TXBUF1 = TXBUF2 = TXBUF3 = 0;
    IPC10bits.DCIIP = 4;
    IFS2bits.DCIIF = 0;
    IEC2bits.DCIIE = 1;
    DCICON1bits.DCIEN = 1;
    for (;;)
        __asm__ volatile("pwrsav #1");
}
