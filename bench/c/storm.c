/* Interrupt every PERIOD + 1 Tcy (default 100 us) over a computing main loop; the handler calls a function. */
#include <p30F6014A.h>
#include <stdint.h>

#include "dspic_compiler.h"

#ifndef PERIOD
#define PERIOD 1473 /* 1474 Tcy = 99.96 us at 14.7456 MIPS */
#endif

static volatile uint16_t ticks;
static volatile uint16_t crc = 0xFFFF;

static void __attribute__((noinline)) count(void)
{
    ticks++;
}

OS_ISR(_T1Interrupt)
{
    IFS0bits.T1IF = 0;
    count();
}

int main(void)
{
    uint16_t random = 1;
    PR1 = PERIOD;
    IEC0bits.T1IE = 1;
    T1CONbits.TON = 1;
    for (;;) {
        random = (uint16_t)(random * 25173u + 13849u);
        uint16_t next = crc ^ (random >> 8);
        for (uint8_t bit = 0; bit < 8; bit++) {
            next = (next & 1) ? (uint16_t)((next >> 1) ^ 0xA001) : (uint16_t)(next >> 1);
        }
        crc = next;
    }
}
