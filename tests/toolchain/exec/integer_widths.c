/* Sizes, ranges, promotions and conversions of integer types. */
#include "exec.h"

#include <limits.h>
#include <stddef.h>

TEST(sizes_of_types, "C11 6.5.3.4")
{
    CHECK(sizeof(char) == 1 && sizeof(short) == 2 && sizeof(int) == 2 && sizeof(long) == 4);
    CHECK(sizeof(long long) == 8 && sizeof(void *) == 2 && sizeof(size_t) == 2 && sizeof(wchar_t) == 2);
    CHECK(sizeof(float) == 4 && sizeof(double) == 8 && sizeof(_Bool) == 1);
}
TEST(limits_hold, "C11 5.2.4.2.1")
{
    CHECK(INT_MAX == 32767 && INT_MIN == -32767 - 1 && UINT_MAX == 65535u && LONG_MAX == 2147483647L);
    CHECK(CHAR_MIN == -128 && SCHAR_MAX == 127 && UCHAR_MAX == 255 && ULLONG_MAX == 18446744073709551615ull);
}
TEST(plain_char_is_signed, "abi-elf.md 1.1")
{
    char c = (char)I(0xFF);
    CHECK(c == -1 && (int)c < 0);
}
TEST(signed_char_promotes_with_sign, "C11 6.3.1.1p2")
{
    CHECK(C(-1) + 0 == -1 && C(-128) * 2 == -256 && C(127) + C(127) == 254);
}
TEST(unsigned_char_promotes_to_int, "C11 6.3.1.1p2")
{
    CHECK(UC(255) + UC(255) == 510 && UC(0) - UC(1) == -1 && ~UC(0) == -1);
}
TEST(integer_constant_types, "C11 6.4.4.1p5")
{
    CHECK(sizeof(32767) == 2 && sizeof(32768) == 4 && sizeof(0xFFFF) == 2 && sizeof(0x10000) == 4 && sizeof(65535u) == 2);
    CHECK(0xFFFF > 0 && sizeof(2147483648) == 8 && sizeof(1ll) == 8);
}
TEST(int_to_signed_char_wraps, "C11 6.3.1.3p3")
{
    signed char c = (signed char)I(0x1280);
    CHECK(c == -128);
    c = (signed char)I(0x34FF);
    CHECK(c == -1);
}
TEST(int_to_unsigned_char_is_modulo, "C11 6.3.1.3p2")
{
    CHECK((unsigned char)I(-1) == 255 && (unsigned char)I(256) == 0 && (unsigned char)I(0x1234) == 0x34);
}
TEST(negative_int_to_unsigned, "C11 6.3.1.3p2")
{
    CHECK((unsigned)I(-1) == 65535u && (unsigned long)I(-1) == 0xFFFFFFFFul && (unsigned long)U(0xFFFF) == 0xFFFFul);
}
TEST(long_to_int_truncates, "C11 6.3.1.3p3")
{
    CHECK((int)L(0x12345678L) == 0x5678 && (int)L(-65536L) == 0 && (int)L(0x8000L) == -32767 - 1);
}
TEST(int_to_long_sign_extends, "C11 6.3.1.3p1")
{
    CHECK((long)I(-2) == -2L && (long)I(32767) == 32767L && L(0) + I(-32767 - 1) == -32768L);
}
TEST(unsigned_to_long_zero_extends, "C11 6.3.1.3p1")
{
    CHECK((long)U(0xFFFE) == 65534L && (long long)U(40000) == 40000LL && (long long)UL(0xFFFFFFFF) == 4294967295LL);
}
TEST(char_to_long_long, "C11 6.3.1.3p1")
{
    CHECK((long long)C(-5) == -5LL && (unsigned long long)C(-5) == 0xFFFFFFFFFFFFFFFBull && (long long)UC(200) == 200);
}
TEST(long_long_to_char, "C11 6.3.1.3p3")
{
    CHECK((signed char)LL(0x1122334455667788LL) == (signed char)0x88 && (unsigned char)LL(-2) == 254);
}
TEST(mixed_int_unsigned_compare, "C11 6.3.1.8p1")
{
    CHECK(I(-1) > U(1));
    CHECK(L(-1) < U(1));
    CHECK(I(-1) > (unsigned long)1);
    CHECK(LL(-1) < UL(1));
}
TEST(unsigned_wraps_on_addition, "C11 6.2.5p9")
{
    CHECK(U(65535u) + 1u == 0 && U(0) - 1u == 65535u && UL(0xFFFFFFFF) + 1 == 0 && ULL(0) - 1 == ULLONG_MAX);
}
TEST(unsigned_multiplication_wraps, "C11 6.2.5p9")
{
    CHECK(U(0x1234) * U(0x5678) == 0x0060u && UL(0x10001) * UL(0x10001) == 0x20001ul);
}
TEST(unsigned_short_product, "C11 6.3.1.8p1")
{
    CHECK((unsigned long)U(0xFFFF) * U(0xFFFF) == 0xFFFE0001ul && U(0xFFFF) * U(0xFFFF) == 1u);
}
TEST(bool_conversion, "C11 6.3.1.2p1")
{
    _Bool b = I(2);
    CHECK(b == 1);
    b = L(0x10000L);
    CHECK(b == 1);
    b = LL(0x100000000LL);
    CHECK(b == 1);
    b = F(0.5f);
    CHECK(b == 1);
    b = D(-0.0);
    CHECK(b == 0);
}
TEST(bool_from_pointer, "C11 6.3.1.2p1")
{
    int x;
    int *volatile p = &x, *volatile q = 0;
    _Bool yes = p, no = q;
    CHECK(yes && !no);
}
TEST(bool_arithmetic, "C11 6.3.1.1p2")
{
    volatile _Bool t = 1, f = 0;
    CHECK(t + t == 2 && t - f == 1 && (t & f) == 0 && ~t == -2 && sizeof(t + t) == 2);
}
TEST(bool_increments_saturate, "C11 6.5.2.4p2")
{
    _Bool b = (_Bool)I(0);
    b++;
    CHECK(b == 1);
    b++;
    CHECK(b == 1);
    b--;
    CHECK(b == 0);
}
TEST(compound_assignment_converts_back, "C11 6.5.16.2p3")
{
    unsigned char c = (unsigned char)I(250);
    c += 10;
    CHECK(c == 4);
    c *= 100;
    CHECK(c == 144);
    signed char s = (signed char)I(100);
    s += I(100);
    CHECK(s == -56);
}
TEST(compound_assignment_wider_right, "C11 6.5.16.2p3")
{
    int i = I(5);
    i *= L(100000L) / L(1000L);
    CHECK(i == 500);
    unsigned u = U(7);
    u += ULL(0x100000001ull);
    CHECK(u == 8);
}
TEST(enum_values_and_sizes, "C11 6.7.2.2p4")
{
    enum small { A = -1, B = 5 };
    enum big { H = 0x12345L };
    volatile enum small s = A;
    CHECK(sizeof(enum small) == 2 && sizeof(enum big) == 4 && s + 1 == 0 && B == 5 && H == 74565L);
}
TEST(unary_minus_and_plus, "C11 6.5.3.3p3")
{
    CHECK(-U(1) == 65535u && -UC(5) == -5 && +C(-7) == -7 && -L(-100000L) == 100000L && sizeof(+UC(1)) == 2);
}
TEST(complement, "C11 6.5.3.3p4")
{
    CHECK(~I(0x1234) == (int)0xEDCB && ~UL(0x12345678) == 0xEDCBA987ul && ~ULL(0) == ULLONG_MAX && ~C(0x55) == -86);
}
TEST(increments_of_narrow_types, "C11 6.5.3.1p2")
{
    volatile unsigned char c = 255;
    volatile signed char s = 127;
    c++;
    ++s;
    CHECK(c == 0 && s == -128);
    --c;
    s--;
    CHECK(c == 255 && s == 127);
}
TEST(increments_of_wide_types, "C11 6.5.3.1p2")
{
    volatile unsigned long l = 0xFFFF;
    volatile long long q = 0xFFFFFFFFll;
    l++;
    q++;
    CHECK(l == 0x10000ul && q == 0x100000000ll);
    l--;
    q--;
    CHECK(l == 0xFFFF && q == 0xFFFFFFFFll);
}
TEST(conditional_operator_converts, "C11 6.5.15p5")
{
    CHECK((I(1) ? -1 : 1u) == 65535u && (I(0) ? 1L : -1) == -1L && sizeof(1 ? (char)1 : (char)2) == 2);
}
