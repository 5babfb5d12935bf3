/* Both motors on one timer: each interrupt, every PR3 + 1 = 14,746 Tcy, steps the left wheel forward, each third one
   the right wheel backward. Bits are written one by one, as in the vendor library (epuck.md §3). */
#include <p30F6014A.h>
#include <stdint.h>

static const uint8_t phase[4] = {0xA, 0x6, 0x5, 0x9};
static uint8_t left, right, third;

static void write_left(uint8_t nibble)
{
    LATDbits.LATD0 = nibble & 1;
    LATDbits.LATD1 = nibble >> 1 & 1;
    LATDbits.LATD2 = nibble >> 2 & 1;
    LATDbits.LATD3 = nibble >> 3 & 1;
}

static void write_right(uint8_t nibble)
{
    LATDbits.LATD4 = nibble & 1;
    LATDbits.LATD5 = nibble >> 1 & 1;
    LATDbits.LATD6 = nibble >> 2 & 1;
    LATDbits.LATD7 = nibble >> 3 & 1;
}

void __attribute__((interrupt, no_auto_psv)) _T3Interrupt(void)
{
    IFS0bits.T3IF = 0;
    left = (left - 1) & 3;
    write_left(phase[left]);
    if (++third == 3) {
        third = 0;
        right = (right - 1) & 3;
        write_right(phase[right]);
    }
}

int main(void)
{
    TRISD &= 0xFF00;
    write_left(phase[0]);
    write_right(phase[0]);
    PR3 = 14745;
    IEC0bits.T3IE = 1;
    T3CON = 0x8000;
    for (;;)
        __asm__ volatile("pwrsav #1");
}
