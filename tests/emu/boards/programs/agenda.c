/* A program built on an agenda like the vendor library's (epuck.md §3, §6): every 1,475 Tcy, T2 calls the
   functions that are due. The entries drive both motors and an LED, and sample the remote control. */
#include <p30F6014A.h>
#include <stddef.h>
#include <stdint.h>

typedef struct entry {
    uint16_t cycle, counter; /* period in ticks, 0: off */
    char active;
    void (*function)(void);
    struct entry *next;
} entry;

volatile uint16_t ticks, keys, address, command, noise;
volatile int16_t speed_left = 500, speed_right = -250;
static uint8_t phase_left, phase_right;
static entry *first;

void __attribute__((interrupt, no_auto_psv)) _T2Interrupt(void)
{
    entry *e;
    IFS0bits.T2IF = 0;
    ticks++;
    for (e = first; e != NULL; e = e->next) {
        if (e->cycle > 0 && e->active) {
            e->counter--;
            if (e->counter == 0) {
                e->function();
                e->counter = e->cycle;
            }
        }
    }
}

static void step_left(void)
{
    phase_left = (uint8_t)((speed_left > 0 ? phase_left - 1 : phase_left + 1) & 3);
    switch (phase_left) {
    case 0: LATDbits.LATD0 = 0; LATDbits.LATD1 = 1; LATDbits.LATD2 = 0; LATDbits.LATD3 = 1; break;
    case 1: LATDbits.LATD0 = 0; LATDbits.LATD1 = 1; LATDbits.LATD2 = 1; LATDbits.LATD3 = 0; break;
    case 2: LATDbits.LATD0 = 1; LATDbits.LATD1 = 0; LATDbits.LATD2 = 1; LATDbits.LATD3 = 0; break;
    case 3: LATDbits.LATD0 = 1; LATDbits.LATD1 = 0; LATDbits.LATD2 = 0; LATDbits.LATD3 = 1; break;
    }
}

static void step_right(void)
{
    phase_right = (uint8_t)((speed_right > 0 ? phase_right + 1 : phase_right - 1) & 3);
    switch (phase_right) {
    case 0: LATDbits.LATD4 = 0; LATDbits.LATD5 = 1; LATDbits.LATD6 = 0; LATDbits.LATD7 = 1; break;
    case 1: LATDbits.LATD4 = 0; LATDbits.LATD5 = 1; LATDbits.LATD6 = 1; LATDbits.LATD7 = 0; break;
    case 2: LATDbits.LATD4 = 1; LATDbits.LATD5 = 0; LATDbits.LATD6 = 1; LATDbits.LATD7 = 0; break;
    case 3: LATDbits.LATD4 = 1; LATDbits.LATD5 = 0; LATDbits.LATD6 = 0; LATDbits.LATD7 = 1; break;
    }
}

static void blink(void)
{
    LATAbits.LATA6 ^= 1;
}

/* RC-5: INT0 detects the first falling edge; then the line is sampled in the middle of the first half of every bit. */
static entry remote;
static uint8_t bit;
static uint16_t collected;

static void look(void)
{
    uint8_t level = (uint8_t)PORTFbits.RF6;
    if (bit == 0) {
        if (level) { /* no start bit */
            noise++;
            remote.active = 0;
            IFS0bits.INT0IF = 0;
            IEC0bits.INT0IE = 1;
            return;
        }
        remote.cycle = 9; /* to the toggle bit, 3.0 ms */
    } else if (bit < 13) {
        remote.cycle = 18;
        collected = (uint16_t)(collected << 1 | level);
    }
    if (++bit == 14) { /* 24.6 ms: after the last bit */
        remote.active = 0;
        address = collected >> 6 & 31;
        command = collected & 63;
        keys++;
        IFS0bits.INT0IF = 0;
        IEC0bits.INT0IE = 1;
    }
}

void __attribute__((interrupt, no_auto_psv)) _INT0Interrupt(void)
{
    IEC0bits.INT0IE = 0;
    IFS0bits.INT0IF = 0;
    bit = 0;
    collected = 0;
    remote.cycle = remote.counter = 21; /* 2.1 ms */
    remote.active = 1;
}

static uint16_t magnitude(int16_t speed)
{
    return (uint16_t)(speed < 0 ? -speed : speed);
}

int main(void)
{
    static entry left, right, lamp;
    TRISD &= 0xFF00;
    TRISAbits.TRISA6 = 0;
    left.function = step_left;
    left.cycle = left.counter = (uint16_t)(10000 / magnitude(speed_left));
    right.function = step_right;
    right.cycle = right.counter = (uint16_t)(10000 / magnitude(speed_right));
    lamp.function = blink;
    lamp.cycle = lamp.counter = 500;
    remote.function = look;
    left.active = right.active = lamp.active = 1;
    left.next = &right;
    right.next = &lamp;
    lamp.next = &remote;
    first = &left;
    INTCON2bits.INT0EP = 1;
    IPC0bits.INT0IP = 5;
    IEC0bits.INT0IE = 1;
    T2CON = 0;
    TMR2 = 0;
    PR2 = 1474;
    IFS0bits.T2IF = 0;
    IEC0bits.T2IE = 1;
    T2CONbits.TON = 1;
    for (;;) {
    }
}
