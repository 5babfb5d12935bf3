/* C11 atomics: results, and indivisibility against interrupts. */
#include "exec.h"

#include <dspic30f6014a.h>
#include <stdatomic.h>

static _Atomic unsigned char byte;
static atomic_uint word;
static atomic_ulong wide;
static atomic_ullong widest;
static volatile unsigned long torn;

TEST(plain_operators, "6.5.2.4p2, 6.5.16.2p3: atomic objects in ordinary expressions")
{
    byte = 250;
    byte += 7;
    word = 0xFFFFu;
    word++;
    wide = 0xFFFFFFFFUL;
    wide += 2;
    widest = 1;
    widest <<= 40;
    CHECK(byte == 1 && word == 0 && wide == 1 && widest == 1ULL << 40);
}
TEST(exchange, "7.17.7.3")
{
    wide = 5;
    CHECK(atomic_exchange(&wide, 9UL) == 5 && wide == 9);
    widest = 5;
    CHECK(atomic_exchange(&widest, ~0ULL) == 5 && widest == ~0ULL);
}
TEST(compare_exchange, "7.17.7.4")
{
    unsigned long expected = 4;
    wide = 5;
    CHECK(!atomic_compare_exchange_strong(&wide, &expected, 6UL) && expected == 5 && wide == 5);
    CHECK(atomic_compare_exchange_strong(&wide, &expected, 6UL) && wide == 6);
    unsigned char small = 1;
    byte = 1;
    CHECK(atomic_compare_exchange_strong(&byte, &small, 2) && byte == 2);
}
TEST(fetch_operations, "7.17.7.5")
{
    wide = 0xF0F0UL;
    CHECK(atomic_fetch_or(&wide, 0xFUL) == 0xF0F0UL && atomic_fetch_and(&wide, 0xFFUL) == 0xF0FFUL);
    CHECK(atomic_fetch_xor(&wide, 0xF000000FUL) == 0xFFUL && atomic_fetch_sub(&wide, 1UL) == 0xF00000F0UL);
    CHECK(wide == 0xF00000EFUL);
}
TEST(a_section_of_the_program_is_not_shortened, "isa.md 12: DISI reloads DISICNT")
{
    __builtin_disi(2000);
    wide += 1;
    widest ^= 1;
    (void)atomic_fetch_add(&word, 1u);
    unsigned left = DISICNT;
    DISICNT = 0;
    CHECK(left > 1000);
}
TEST(a_short_section_is_not_shortened, "isa.md 12")
{
    PR1 = 0xFFFF;
    T1CON = 0x8000;
    for (unsigned k = 0; k < 100; k++) {
        __asm__ volatile("disi #120\n\trepeat %0\n\tnop" ::"r"(k));
        unsigned start = TMR1, before = DISICNT;
        atomic_fetch_add(&widest, 1ULL);
        unsigned after = DISICNT, passed = TMR1 - start;
        DISICNT = 0;
        CHECK(after + passed >= before);
    }
    T1CON = 0;
}

__attribute__((interrupt, no_auto_psv)) void _T1Interrupt(void)
{
    IFS0bits.T1IF = 0;
    unsigned long w = wide;
    if ((unsigned)w != (unsigned)(w >> 16) && (unsigned)w != (unsigned)(w >> 16) + 1)
        torn++;
    wide += 0x00010001UL;
    widest += 1;
}
TEST(nothing_is_lost_between_interrupts, "7.17.3: indivisible")
{
    wide = 0;
    widest = 0;
    torn = 0;
    TMR1 = 0;
    PR1 = 180;
    IPC0bits.T1IP = 4;
    IFS0bits.T1IF = 0;
    IEC0bits.T1IE = 1;
    T1CON = 0x8000;
    for (unsigned k = 0; k < 1000; k++) {
        wide += 0x00010001UL;
        widest += 1;
        PR1 = 170 + k % 23;
    }
    T1CON = 0;
    IEC0bits.T1IE = 0;
    CHECK(torn == 0);
    CHECK((unsigned)wide == (unsigned)(wide >> 16) && widest == (unsigned)wide && widest > 1005);
}
