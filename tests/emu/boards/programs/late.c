/* Alternates scans of three and of five channels with the converter always on; one interrupt is delayed. */
#include <p30F6014A.h>
#include <stdint.h>

#define LATE_ROUND 5

volatile uint16_t rounds, seen[24][5];

void __attribute__((interrupt, no_auto_psv)) _ADCInterrupt(void)
{
    IFS0bits.ADIF = 0;
    if (rounds < 24) {
        seen[rounds][0] = ADCBUF0;
        seen[rounds][1] = ADCBUF1;
        seen[rounds][2] = ADCBUF2;
        seen[rounds][3] = ADCBUF3;
        seen[rounds][4] = ADCBUF4;
    }
    if (rounds == LATE_ROUND)
        __asm__ volatile("repeat #1580\n nop"); /* delay of three and a half conversions */
    if (rounds & 1) {
        ADCSSL = 0x001C;
        ADCON2 = 0x0408;
    } else {
        ADCSSL = 0x3E00;
        ADCON2 = 0x0410;
    }
    rounds++;
}

int main(void)
{
    ADPCFG = 0;
    ADCON3 = 0x1F13; /* 31 TAD of sampling: the handler ends while the first input is sampled */
    ADCSSL = 0x001C;
    ADCON2 = 0x0408;
    IEC0bits.ADIE = 1;
    ADCON1 = 0x80E4;
    for (;;)
        ;
}
