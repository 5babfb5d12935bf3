/* Shifts of every width by constants and variables. */
#include "exec.h"

TEST(left_16_constant, "C11 6.5.7p4") { CHECK(I(3) << 4 == 48 && U(0x8001) << 1 == 2 && U(1) << 15 == 0x8000u && U(0xFFFF) << 8 == 0xFF00u); }
TEST(right_unsigned_16_constant, "C11 6.5.7p5") { CHECK(U(0x8000) >> 15 == 1 && U(0xFFFF) >> 1 == 0x7FFF && U(0x1234) >> 8 == 0x12); }
TEST(right_signed_16_is_arithmetic, "C11 6.5.7p5") { CHECK(I(-8) >> 1 == -4 && I(-1) >> 15 == -1 && I(-32768L) >> 15 == -1 && I(0x4000) >> 14 == 1); }
TEST(left_16_variable, "C11 6.5.7p4")
{
    for (int n = 0; n < 16; n++)
        CHECK((U(1) << n) == (unsigned)(1ul << n));
}
TEST(right_16_variable, "C11 6.5.7p5")
{
    for (int n = 0; n < 16; n++)
        CHECK((U(0x8000) >> n) == (unsigned)(0x8000ul >> n) && (I(-32768L) >> n) == (int)(-32768L >> n));
}
TEST(left_32_constant, "C11 6.5.7p4") { CHECK(UL(0x12345678) << 1 == 0x2468ACF0ul && UL(0x12345678) << 4 == 0x23456780ul && UL(0x12345678) << 8 == 0x34567800ul); }
TEST(left_32_constant_high, "C11 6.5.7p4") { CHECK(UL(0x12345678) << 16 == 0x56780000ul && UL(0x12345678) << 20 == 0x67800000ul && UL(1) << 31 == 0x80000000ul); }
TEST(right_unsigned_32_constant, "C11 6.5.7p5") { CHECK(UL(0x92345678) >> 1 == 0x491A2B3Cul && UL(0x92345678) >> 4 == 0x09234567ul && UL(0x92345678) >> 12 == 0x00092345ul); }
TEST(right_unsigned_32_constant_high, "C11 6.5.7p5") { CHECK(UL(0x92345678) >> 16 == 0x9234 && UL(0x92345678) >> 24 == 0x92 && UL(0x92345678) >> 31 == 1); }
TEST(right_signed_32_constant, "C11 6.5.7p5") { CHECK(L(-256) >> 4 == -16 && L(-1) >> 31 == -1 && L(-65536) >> 16 == -1 && L(-131072) >> 16 == -2 && L(0x40000000) >> 30 == 1); }
TEST(left_32_variable, "C11 6.5.7p4")
{
    unsigned long want = 1;
    for (int n = 0; n < 32; n++, want += want)
        CHECK(UL(1) << n == want);
}
TEST(right_32_variable, "C11 6.5.7p5")
{
    unsigned long pattern = UL(0xA5A5C3C3);
    unsigned long want = pattern;
    for (int n = 0; n < 32; n++, want /= 2)
        CHECK(pattern >> n == want);
}
TEST(right_signed_32_variable, "C11 6.5.7p5")
{
    long want = L(-2147483647 - 1);
    for (int n = 0; n < 31; n++, want /= 2)
        CHECK(L(-2147483647 - 1) >> n == want);
}
TEST(left_64_constant, "C11 6.5.7p4") { CHECK(ULL(0x123456789ABCDEF0) << 4 == 0x23456789ABCDEF00ull && ULL(0x123456789ABCDEF0) << 16 == 0x56789ABCDEF00000ull && ULL(1) << 63 == 0x8000000000000000ull && ULL(3) << 33 == 0x600000000ull); }
TEST(right_64_constant, "C11 6.5.7p5") { CHECK(ULL(0x923456789ABCDEF0) >> 4 == 0x0923456789ABCDEFull && ULL(0x923456789ABCDEF0) >> 32 == 0x92345678ull && ULL(0x923456789ABCDEF0) >> 63 == 1); }
TEST(right_signed_64_constant, "C11 6.5.7p5") { CHECK(LL(-1) >> 63 == -1 && LL(-0x100000000ll) >> 32 == -1 && LL(-0x1000000000000ll) >> 47 == -2); }
TEST(left_64_variable, "C11 6.5.7p4")
{
    unsigned long long want = 1;
    for (int n = 0; n < 64; n++, want += want)
        CHECK(ULL(1) << n == want);
}
TEST(right_64_variable, "C11 6.5.7p5")
{
    unsigned long long pattern = ULL(0xF0E1D2C3B4A59687);
    unsigned long long want = pattern;
    for (int n = 0; n < 64; n++, want /= 2)
        CHECK(pattern >> n == want);
}
TEST(right_signed_64_variable, "C11 6.5.7p5")
{
    long long want = LL(-0x7FFFFFFFFFFFFFFFll - 1);
    for (int n = 0; n < 63; n++, want /= 2)
        CHECK(LL(-0x7FFFFFFFFFFFFFFFll - 1) >> n == want);
}
TEST(narrow_operand_promotes, "C11 6.5.7p3") { CHECK(UC(0x80) << 1 == 0x100 && UC(0xFF) << 8 == (int)0xFF00 && UC(0x80) >> 7 == 1 && C(-128) >> 7 == -1); }
TEST(right_operand_does_not_widen, "C11 6.5.7p3") { CHECK(sizeof(1 << 1L) == 2 && (U(1) << L(3)) == 8 && (UL(1) << UC(20)) == 0x100000ul); }
TEST(shift_assignment_of_narrow_objects, "C11 6.5.16.2p3")
{
    unsigned char c = UC(0xC3);
    c <<= 2;
    CHECK(c == 0x0C);
    c = UC(0xC3);
    c >>= 2;
    CHECK(c == 0x30);
    signed char s = C(-100);
    s >>= 2;
    CHECK(s == -25);
}
TEST(rotate_idiom_16, "C11 6.5.7")
{
    unsigned x = U(0x8421);
    CHECK((unsigned)(x << 4 | x >> 12) == 0x4218u && (unsigned)(x >> 1 | x << 15) == 0xC210u);
}
TEST(rotate_idiom_32, "C11 6.5.7")
{
    unsigned long x = UL(0x80000001);
    CHECK((x << 1 | x >> 31) == 3 && (x >> 8 | x << 24) == 0x01800000ul && (x << 16 | x >> 16) == 0x00018000ul);
}
TEST(rotate_by_variable, "C11 6.5.7")
{
    unsigned n = U(5);
    unsigned x = U(0x1234);
    CHECK((unsigned)(x << (n & 15) | x >> (-n & 15)) == 0x4682u);
}
TEST(byte_swap, "C11 6.5.7")
{
    unsigned x = U(0x1234);
    unsigned long y = UL(0x12345678);
    CHECK((unsigned)(x << 8 | x >> 8) == 0x3412u && __builtin_bswap16(x) == 0x3412u && __builtin_bswap32(y) == 0x78563412ul);
}
TEST(extract_and_combine_bytes, "C11 6.5.7")
{
    unsigned long x = UL(0xDEADBEEF);
    unsigned char b[4] = {(unsigned char)x, (unsigned char)(x >> 8), (unsigned char)(x >> 16), (unsigned char)(x >> 24)};
    CHECK(b[0] == 0xEF && b[1] == 0xBE && b[2] == 0xAD && b[3] == 0xDE);
    CHECK(((unsigned long)b[3] << 24 | (unsigned long)b[2] << 16 | (unsigned)b[1] << 8 | b[0]) == 0xDEADBEEFul);
}
TEST(bit_tests, "C11 6.5.7")
{
    unsigned mask = U(0x8421);
    int count = 0;
    for (int bit = 0; bit < 16; bit++)
        if (mask >> bit & 1)
            count++;
    CHECK(count == 4 && __builtin_popcount(mask) == 4 && __builtin_clz(U(1)) == 15 && __builtin_ctz(U(0x8000)) == 15);
}
TEST(bit_builtins_wide, "GNU builtins")
{
    CHECK(__builtin_clzl(UL(0x10000)) == 15 && __builtin_ctzl(UL(0x10000)) == 16 && __builtin_popcountl(UL(0xF000F00F)) == 12);
    CHECK(__builtin_clzll(ULL(1)) == 63 && __builtin_ctzll(ULL(1) << 40) == 40 && __builtin_ffs(I(8)) == 4 && __builtin_ffs(I(0)) == 0);
    CHECK(__builtin_parity(U(7)) == 1 && __builtin_popcountll(ULL(0xFFFF00000000000F)) == 20);
}
