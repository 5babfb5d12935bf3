/* Runs the ADC with settings that the test writes into variables; each interrupt may switch it off and on. */
#include <p30F6014A.h>
#include <stdint.h>

volatile uint16_t con1 = 0x00E4, con2 = 0x0408, con3 = 0x0113, chs, cssl = 0x001C, ways;
volatile uint16_t rounds, seen[16], status;

void __attribute__((interrupt, no_auto_psv)) _ADCInterrupt(void)
{
    if (ways & 1)
        ADCON1bits.ADON = 0;
    IFS0bits.ADIF = 0;
    status ^= ADCON1;
    if (ways & 2) {
        seen[0] = ADCBUF0;
        seen[1] = ADCBUF1;
        seen[2] = ADCBUF8;
    }
    rounds++;
    if ((ways & 4) && (rounds & 7) == 0)
        ADCSSL = cssl ^ (rounds & 8 ? 0x1100 : 0);
    if (ways & 8)
        LATF = rounds & 64 ? 0x80 : 0;
    if (ways & 1)
        ADCON1bits.ADON = 1;
}

int main(void)
{
    TRISF = 0xFF7F;
    ADPCFG = 0;
    ADCON2 = con2;
    ADCON3 = con3;
    ADCHS = chs;
    ADCSSL = cssl;
    IEC0bits.ADIE = 1;
    ADCON1 = con1;
    ADCON1bits.ADON = 1;
    for (;;) {
        if (ways & 16)
            __asm__ volatile("pwrsav #1");
        else
            status += ADCON1;
    }
}
