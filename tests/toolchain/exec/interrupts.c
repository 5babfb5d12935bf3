/* Interrupt functions: saved registers, return, nesting. */
#include "exec.h"

#include <dspic30f6014a.h>

static volatile int ticks;
static volatile long wide_sum;
static volatile unsigned long long wide_product;
static volatile int nested, order[4], at;
static volatile float scaled;

/* Sets the flag and waits until the interrupt is taken (isa.md §14.3). */
static void request(void) { IFS0bits.T1IF = 1; Nop(); Nop(); Nop(); Nop(); Nop(); Nop(); Nop(); Nop(); }

OS_ISR(_T1Interrupt)
{
    IFS0bits.T1IF = 0;
    ticks++;
}
TEST(simple_handler_runs, "abi-elf.md 2.5") { ticks = 0; IEC0bits.T1IE = 1; request(); request(); IEC0bits.T1IE = 0; CHECK(ticks == 2); }
TEST(masked_handler_waits, "isa.md 14.1")
{
    ticks = 0;
    IEC0bits.T1IE = 1;
    SRbits.IPL = 7;
    request();
    int masked = ticks;
    SRbits.IPL = 0;
    Nop(); Nop(); Nop(); Nop(); Nop(); Nop();
    IEC0bits.T1IE = 0;
    CHECK(masked == 0 && ticks == 1);
}
NOINLINE static long helper(long x) { return x * 3 + ticks; }
OS_ISR(_T2Interrupt)
{
    IFS0bits.T2IF = 0;
    wide_sum = helper(wide_sum) / 7;
    wide_product = wide_product * 0x100000001ull + 5;
}
TEST(handler_that_calls_functions, "abi-elf.md 2.5")
{
    ticks = 0;
    wide_sum = 700000L;
    wide_product = 3;
    int a = I(1), b = I(2), c = I(3);
    long d = L(400000), e = L(-500000);
    IEC0bits.T2IE = 1;
    IFS0bits.T2IF = 1;
    Nop(); Nop(); Nop(); Nop(); Nop(); Nop();
    IEC0bits.T2IE = 0;
    CHECK(wide_sum == 300000L && wide_product == 0x300000008ull);
    CHECK(a == 1 && b == 2 && c == 3 && d == 400000 && e == -500000);
}
OS_ISR(_T3Interrupt)
{
    IFS0bits.T3IF = 0;
    int copy[6];
    for (int i = 0; i < 6; i++)
        copy[i] = ticks + i;
    volatile int *p = copy;
    scaled = (float)p[5] * 0.5f;
}
TEST(handler_with_frame_and_float, "abi-elf.md 2.5")
{
    ticks = 3;
    IEC0bits.T3IE = 1;
    IFS0bits.T3IF = 1;
    Nop(); Nop(); Nop(); Nop(); Nop(); Nop();
    IEC0bits.T3IE = 0;
    CHECK(scaled == 4.0f);
}
OS_ISR_SHADOW(_T4Interrupt)
{
    IFS1bits.T4IF = 0;
    nested += 100;
    order[at++ & 3] = 4;
}
OS_ISR(_T5Interrupt)
{
    IFS1bits.T5IF = 0;
    order[at++ & 3] = 5;
    IFS1bits.T4IF = 1; /* higher priority: nested in this handler */
    Nop(); Nop(); Nop(); Nop(); Nop(); Nop();
    order[at++ & 3] = 55;
    nested++;
}
TEST(nesting_by_priority, "isa.md 14.1")
{
    at = nested = 0;
    IPC5bits.T4IP = 6;
    IPC5bits.T5IP = 3;
    IEC1bits.T4IE = IEC1bits.T5IE = 1;
    IFS1bits.T5IF = 1;
    Nop(); Nop(); Nop(); Nop(); Nop(); Nop();
    IEC1bits.T4IE = IEC1bits.T5IE = 0;
    IPC5bits.T4IP = IPC5bits.T5IP = 4;
    CHECK(nested == 101 && order[0] == 5 && order[1] == 4 && order[2] == 55);
}
OS_ISR_AUTO_PSV(_INT1Interrupt)
{
    static const int table[4] = {11, 22, 33, 44};
    IFS1bits.INT1IF = 0;
    ticks = table[ticks & 3];
}
TEST(auto_psv_handler_reads_constants, "abi-elf.md 2.5")
{
    ticks = 2;
    unsigned page = PSVPAG;
    IEC1bits.INT1IE = 1;
    PSVPAG = 0x7F;
    IFS1bits.INT1IF = 1;
    Nop(); Nop(); Nop(); Nop(); Nop(); Nop();
    unsigned kept = PSVPAG;
    PSVPAG = page;
    IEC1bits.INT1IE = 0;
    CHECK(ticks == 33 && kept == 0x7F);
}
void __attribute__((__interrupt__, __no_auto_psv__)) _INT2Interrupt(void)
{
    IFS1bits.INT2IF = 0;
    ticks = -ticks;
}
TEST(attribute_spelling, "abi-elf.md 2.5") { ticks = 9; IEC1bits.INT2IE = 1; IFS1bits.INT2IF = 1; Nop(); Nop(); Nop(); Nop(); Nop(); Nop(); IEC1bits.INT2IE = 0; CHECK(ticks == -9); }
TEST(timer_interrupts_a_computation, "abi-elf.md 2.5")
{
    ticks = 0;
    PR1 = 97;
    TMR1 = 0;
    IFS0bits.T1IF = 0;
    IEC0bits.T1IE = 1;
    T1CON = 0x8000;
    unsigned long long x = ULL(1), y = 1;
    long q = 0;
    for (int i = 1; i < 60; i++) {
        x = x * 31 + (unsigned)i;
        q += L(1000000) / i % 97;
    }
    T1CON = 0;
    IEC0bits.T1IE = 0;
    long r = 0;
    for (int i = 1; i < 60; i++) {
        y = y * 31 + (unsigned)i;
        r += L(1000000) / i % 97;
    }
    CHECK(ticks > 50 && x == y && q == r);
}
TEST(interrupted_repeat_loops, "abi-elf.md 2.5")
{
    static unsigned char from[200], to[200];
    for (int i = 0; i < 200; i++)
        from[i] = (unsigned char)(i * 3);
    PR1 = 41;
    IFS0bits.T1IF = 0;
    IEC0bits.T1IE = 1;
    T1CON = 0x8000;
    for (int turn = 0; turn < 20; turn++) {
        __builtin_memset(to, 0, sizeof to);
        __builtin_memcpy(to, from, (unsigned)I(200));
        for (int i = 0; i < 200; i++)
            if (to[i] != (unsigned char)(i * 3))
                turn = 100;
        if (turn >= 100)
            break;
    }
    T1CON = 0;
    IEC0bits.T1IE = 0;
    int same = 1;
    for (int i = 0; i < 200; i++)
        same &= to[i] == from[i];
    CHECK(same && ticks > 20);
}
