/* The vendor library's scan of all analog inputs: microphones in every scan, the accelerometer and one infrared
   pair once per 65 scans, with the pair's emitters on for five scans (epuck.md §5, "advance_ad_scan"). */
#include <p30F6014A.h>
#include <stdint.h>

volatile int16_t microphone[3], acceleration[3], ambient[8], reflected[8];
volatile uint16_t rounds, scans;
static uint8_t place, pair;

static void select_channels(uint16_t channels, uint8_t count, uint8_t clock)
{
    ADCSSL = channels;
    ADCON2 = 0x0400 | (uint16_t)(count - 1) << 2;
    ADCON3 = 0x0100 | clock;
}

static void emitters(uint8_t on)
{
    if (pair == 0)
        LATFbits.LATF7 = on;
    else if (pair == 1)
        LATFbits.LATF8 = on;
    else if (pair == 2)
        LATGbits.LATG0 = on;
    else
        LATGbits.LATG1 = on;
}

void __attribute__((interrupt, no_auto_psv)) _ADCInterrupt(void)
{
    ADCON1bits.ADON = 0;
    IFS0bits.ADIF = 0;
    microphone[0] = ADCBUF0;
    microphone[1] = ADCBUF1;
    microphone[2] = ADCBUF2;
    scans++;
    if (place == 61) {
        select_channels(0x00FC, 6, 19);
    } else if (place == 62) {
        acceleration[0] = ADCBUF3;
        acceleration[1] = ADCBUF4;
        acceleration[2] = ADCBUF5;
        select_channels(0x1100 << pair | 0x001C, 5, 23);
    } else if (place == 63) {
        ambient[pair] = ADCBUF3;
        ambient[pair + 4] = ADCBUF4;
        emitters(1);
        select_channels(0x001C, 3, 39);
    } else if (place == 2) {
        select_channels(0x1100 << pair | 0x001C, 5, 23);
    } else if (place == 3) {
        reflected[pair] = ambient[pair] - (int16_t)ADCBUF3;
        reflected[pair + 4] = ambient[pair + 4] - (int16_t)ADCBUF4;
        emitters(0);
        pair = (pair + 1) & 3;
        if (pair == 0)
            rounds++;
        select_channels(0x001C, 3, 39);
    }
    place = place == 64 ? 0 : place + 1;
    ADCON1bits.ADON = 1;
}

int main(void)
{
    TRISFbits.TRISF7 = TRISFbits.TRISF8 = TRISGbits.TRISG0 = TRISGbits.TRISG1 = 0;
    ADPCFG = 0;
    select_channels(0x001C, 3, 39);
    IEC0bits.ADIE = 1;
    ADCON1 = 0x80E4;
    for (;;)
        __asm__ volatile("pwrsav #1");
}
