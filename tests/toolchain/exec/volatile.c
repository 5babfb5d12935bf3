/* Volatile objects: every write is stored and every read is loaded. */
#include "exec.h"

volatile unsigned long tick;
volatile unsigned pair[2];
volatile unsigned char byte_flag;
struct port { volatile unsigned low : 4, middle : 3, top : 9; };
volatile struct port port;

NOINLINE void high_first(volatile unsigned *p, unsigned high, unsigned low) { p[1] = high; p[0] = low; }
NOINLINE unsigned long both(volatile unsigned *p) { unsigned high = p[1]; return (unsigned long)high << 16 | p[0]; }
NOINLINE void count(void) { tick++; }

TEST(pair_written_high_first, "6.7.3p7") { high_first(pair, U(0x1234), U(0x5678)); CHECK(both(pair) == 0x12345678UL); }
TEST(wide_counter, "6.7.3p7")
{
    tick = 0xFFFFUL;
    count();
    CHECK(tick == 0x10000UL);
    tick += 0x1FFFFUL;
    CHECK(tick == 0x2FFFFUL);
}
TEST(byte_flag_in_place, "6.7.3p7") { byte_flag = 1; byte_flag |= 0x80; byte_flag ^= 3; CHECK(byte_flag == 0x82); }
TEST(bit_fields_in_place, "6.7.3p7")
{
    port.low = 9;
    port.middle = 5;
    port.top = 0x155;
    port.middle = U(2);
    CHECK(port.low == 9 && port.middle == 2 && port.top == 0x155);
}
TEST(bits_in_branches, "6.7.3p7")
{
    for (unsigned k = 0; k < 4; k++) {
        byte_flag = 0x12;
        pair[0] = 0xFF00;
        if (U(k) & 1)
            byte_flag |= 0x80;
        else
            byte_flag &= ~0x10;
        if (U(k) & 2)
            pair[0] ^= 0x8000;
        else
            pair[0] |= 1;
        CHECK(byte_flag == (k & 1 ? 0x92 : 0x02) && pair[0] == (k & 2 ? 0x7F00 : 0xFF01));
    }
}
