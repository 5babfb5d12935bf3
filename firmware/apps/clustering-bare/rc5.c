/* RC-5 by sampling, as the robot's library does it: t = 0 is the falling edge in the middle of the first start bit, the
 * line is low 2.1 ms later; from 3.0 ms on there is a bit every 1.778 ms, toggle first (epuck.md §6). */
#include "bare.h"

enum {
    BITS = 12, /* toggle, 5 of the address, 6 of the command */
    PRIORITY = 4,
    TIMER_ON = 0x8010, /* 1:8, 1.8432 MHz */
    CHECK = 3871,      /* 2.1 ms */
    FIRST = 1659,      /* 0.9 ms later */
    BIT = 3277,        /* 1.778 ms */
    LINE = 0x0040      /* RF6 */
};

static volatile uint8_t command = RC5_NOTHING;
static uint16_t bits, last = 0xFFFF;
static uint8_t samples;

OS_ISR(_INT0Interrupt)
{
    IEC0bits.INT0IE = 0;
    samples = 0;
    bits = 0;
    TMR1 = 0;
    PR1 = CHECK - 1;
    IFS0bits.T1IF = 0;
    T1CON = TIMER_ON;
}

static void listen(void)
{
    T1CON = 0;
    IFS0bits.INT0IF = 0;
    IEC0bits.INT0IE = 1;
}

OS_ISR(_T1Interrupt)
{
    IFS0bits.T1IF = 0;
    uint16_t level = PORTF & LINE;
    if (samples == 0) {
        if (level) {
            listen();
        }
        PR1 = FIRST - 1;
    } else {
        bits = (uint16_t)(bits << 1 | (level ? 1u : 0u));
        PR1 = BIT - 1;
    }
    if (samples++ == BITS) {
        if (bits != last) {
            last = bits;
            command = (uint8_t)(bits & 63u);
        }
        listen();
    }
}

void rc5_init(void)
{
    INTCON2bits.INT0EP = 1;
    IPC0bits.INT0IP = PRIORITY;
    IPC0bits.T1IP = PRIORITY;
    IEC0bits.T1IE = 1;
    listen();
}

uint8_t rc5_take(void)
{
    uint8_t taken = command;
    if (taken != RC5_NOTHING) {
        command = RC5_NOTHING;
    }
    return taken;
}
