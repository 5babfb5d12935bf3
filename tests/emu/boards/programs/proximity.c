/* The vendor library's polled proximity driver (epuck.md §5): converts without light, turns the emitter on, waits
   350 us, converts again. A command byte on UART2 starts one round over all eight sensors. */
#include <p30F6014A.h>
#include <stdint.h>

volatile int16_t ambient[8], reflected[8];
volatile uint16_t rounds;

static int16_t convert(uint8_t channel)
{
    ADCHS = channel;
    ADCON1bits.SAMP = 1;
    for (volatile int i = 0; i < 8; i++) {
    }
    IFS0bits.ADIF = 0;
    ADCON1bits.SAMP = 0;
    while (!IFS0bits.ADIF) {
    }
    return (int16_t)ADCBUF0;
}

static void wait_350us(void)
{
    TMR1 = 0;
    PR1 = 645;
    IFS0bits.T1IF = 0;
    T1CON = 0x8010;
    while (!IFS0bits.T1IF) {
    }
    T1CON = 0;
}

static void emitter(uint8_t line, uint8_t on)
{
    if (line == 0)
        LATFbits.LATF7 = on;
    else if (line == 1)
        LATFbits.LATF8 = on;
    else if (line == 2)
        LATGbits.LATG0 = on;
    else
        LATGbits.LATG1 = on;
}

int main(void)
{
    TRISFbits.TRISF7 = TRISFbits.TRISF8 = TRISGbits.TRISG0 = TRISGbits.TRISG1 = 0;
    ADCON3 = 18;
    ADCON1 = 0x8000;
    for (;;) {
        for (uint8_t line = 0; line < 4; line++) {
            ambient[line] = convert(8 + line);
            ambient[line + 4] = convert(12 + line);
            emitter(line, 1);
            wait_350us();
            reflected[line] = ambient[line] - convert(8 + line);
            reflected[line + 4] = ambient[line + 4] - convert(12 + line);
            emitter(line, 0);
            wait_350us();
        }
        rounds++;
    }
}
