/* Addition, subtraction, multiplication, division, comparison in 8, 16 and 32 bits. */
#include "exec.h"

#include <limits.h>

TEST(add_16, "C11 6.5.6p5") { CHECK(I(1234) + I(-234) == 1000 && I(-20000) + I(-12768) == -32768L); }
TEST(subtract_16, "C11 6.5.6p6") { CHECK(I(5) - I(7) == -2 && U(5) - U(7) == 65534u && I(-32768L) - I(-1) == -32767); }
TEST(add_32_carries, "C11 6.5.6p5") { CHECK(UL(0x0000FFFF) + UL(1) == 0x10000ul && L(-1) + L(1) == 0 && L(0x7FFF8000) + I(0x7FFF) == 0x7FFFFFFF); }
TEST(subtract_32_borrows, "C11 6.5.6p6") { CHECK(UL(0x10000) - UL(1) == 0xFFFF && L(0) - L(1) == -1L && UL(0) - UL(0x10000) == 0xFFFF0000ul); }
TEST(multiply_16, "C11 6.5.5p4") { CHECK(I(-123) * I(45) == -5535 && I(181) * I(181) == 32761 && I(-181) * I(-181) == 32761); }
TEST(multiply_16_to_32, "C11 6.3.1.8p1") { CHECK((long)I(30000) * I(30000) == 900000000L && (long)I(-30000) * I(30000) == -900000000L); }
TEST(multiply_mixed_sign_to_32, "C11 6.3.1.8p1") { CHECK((long)I(-2) * (long)U(60000) == -120000L && (long)U(60000) * I(-3) == -180000L); }
TEST(multiply_32, "C11 6.5.5p4") { CHECK(L(12345) * L(6789) == 83810205L && L(-70000) * L(30000) == -2100000000L && UL(0xFFFFFFFF) * UL(0xFFFFFFFF) == 1); }
TEST(multiply_8, "C11 6.5.5p4") { CHECK(C(-128) * C(-128) == 16384); }
TEST(multiply_by_constants, "C11 6.5.5p4") { CHECK(I(7) * 3 == 21 && I(7) * 10 == 70 && I(-7) * 100 == -700 && U(300) * 200 == 60000u && L(3) * 1000000L == 3000000L); }
TEST(divide_16_truncates, "C11 6.5.5p6") { CHECK(I(7) / I(2) == 3 && I(-7) / I(2) == -3 && I(7) / I(-2) == -3 && I(-7) / I(-2) == 3); }
TEST(remainder_16_sign, "C11 6.5.5p6") { CHECK(I(7) % I(3) == 1 && I(-7) % I(3) == -1 && I(7) % I(-3) == 1 && I(-7) % I(-3) == -1); }
TEST(divide_unsigned_16, "C11 6.5.5p5") { CHECK(U(65535) / U(10) == 6553 && U(65535) % U(10) == 5 && U(40000) / U(40001) == 0 && U(65535) / U(65535) == 1); }
TEST(divide_by_powers_of_two, "C11 6.5.5p6") { CHECK(I(-9) / 2 == -4 && I(-9) % 2 == -1 && I(-32767) / 8 == -4095 && I(-1) / 4 == 0 && I(-1) % 4 == -1 && U(65535) / 16 == 4095 && U(65535) % 16 == 15); }
TEST(divide_by_constants, "C11 6.5.5p6") { CHECK(I(-1000) / 10 == -100 && I(999) / 10 == 99 && I(-999) % 10 == -9 && U(60000) / 7 == 8571 && U(60000) % 7 == 3 && I(32767) / 100 == 327); }
TEST(divide_extremes_16, "C11 6.5.5p6") { CHECK(I(-32768L) / I(2) == -16384 && I(-32768L) / I(1) == -32768L && I(32767) / I(-32768L) == 0 && I(-32768L) % I(32767) == -1); }
TEST(divide_32_by_16, "C11 6.5.5p6") { CHECK(L(1000000) / I(7) == 142857L && L(1000000) % I(7) == 1 && L(-1000000) / I(7) == -142857L && UL(0xFFFFFFFF) / U(3) == 0x55555555ul); }
TEST(divide_32_by_32, "C11 6.5.5p6") { CHECK(L(2147483647) / L(65537) == 32767L && L(2147483647) % L(65537) == 32768L - 0 && UL(4000000000) / UL(3999999999) == 1); }
TEST(divide_32_signs, "C11 6.5.5p6") { CHECK(L(-100000) / L(70000) == -1 && L(-100000) % L(70000) == -30000L && L(100000) % L(-70000) == 30000L && L(-2147483647 - 1) / L(2) == -1073741824L); }
TEST(divide_32_quotient_corner, "C11 6.5.5p5") { CHECK(UL(0xFFFFFFFF) / UL(0x10000) == 0xFFFF && UL(0xFFFFFFFF) % UL(0x10000) == 0xFFFF && UL(0x80000000) / UL(0x80000001) == 0 && UL(0xFFFEFFFF) / UL(0x1FFFF) == 0x7FFF); }
TEST(division_identity_32, "C11 6.5.5p6")
{
    static const long values[] = {1, -1, 7, -7, 65535, 65536, -65537, 123456789, -987654321, 2147483647};
    for (unsigned i = 0; i < sizeof values / sizeof *values; i++)
        for (unsigned j = 0; j < sizeof values / sizeof *values; j++)
            CHECK(values[i] / values[j] * values[j] + values[i] % values[j] == values[i]);
}
TEST(division_identity_16, "C11 6.5.5p6")
{
    static const int values[] = {1, -1, 2, 3, -3, 10, 255, 256, -257, 12345, -32767, 32767};
    for (unsigned i = 0; i < sizeof values / sizeof *values; i++)
        for (unsigned j = 0; j < sizeof values / sizeof *values; j++)
            CHECK(values[i] / values[j] * values[j] + values[i] % values[j] == values[i]);
}
TEST(compare_signed_16, "C11 6.5.8p6") { CHECK(I(-32768L) < I(32767) && I(-1) < I(0) && !(I(3) < I(3)) && I(3) <= I(3) && I(4) > I(-4) && I(-4) >= I(-4)); }
TEST(compare_unsigned_16, "C11 6.5.8p6") { CHECK(U(65535) > U(0) && U(32768) > U(32767) && U(1) < U(65535) && U(7) >= U(7) && U(7) <= U(7)); }
TEST(compare_32, "C11 6.5.8p6") { CHECK(L(-1) < L(1) && L(65536) > L(65535) && L(-65536) < L(-65535) && UL(0x80000000) > UL(0x7FFFFFFF) && L(0x10000) != L(0)); }
TEST(compare_32_equal_low_words, "C11 6.5.9p3") { CHECK(L(0x12345678) != L(0x22345678) && L(0x12345678) == L(0x12345678) && !(L(0x00010000) == L(0))); }
TEST(compare_8, "C11 6.5.8p6") { CHECK(C(-1) < C(0) && UC(255) > UC(0) && C(-128) < C(127) && UC(128) > C(-128)); }
TEST(comparison_value_is_int, "C11 6.5.8p6") { int r = (I(3) > I(2)) + (I(3) == I(3)) + (I(1) > I(2)); CHECK(r == 2 && sizeof(1L < 2L) == 2); }
TEST(bitwise_16, "C11 6.5.10-12") { CHECK((I(0x0FF0) & I(0x3C3C)) == 0x0C30 && (I(0x0FF0) | I(0x3C3C)) == 0x3FFC && (I(0x0FF0) ^ I(0x3C3C)) == 0x33CC); }
TEST(bitwise_32, "C11 6.5.10-12") { CHECK((UL(0xF0F0FF00) & UL(0x3C3C0FF0)) == 0x30300F00ul && (UL(0xF0F0FF00) | UL(1)) == 0xF0F0FF01ul && (UL(0xFFFF0000) ^ UL(0xFF00FF00)) == 0x00FFFF00ul); }
TEST(logical_operators, "C11 6.5.13-14") { CHECK((I(5) && I(0)) == 0 && (I(0) || L(0x10000)) == 1 && !I(5) == 0 && !L(0) == 1 && !LL(0x100000000ll) == 0); }
TEST(min_max_abs, "C11 6.5.15")
{
    int a = I(-7), b = I(3);
    CHECK((a < b ? a : b) == -7 && (a > b ? a : b) == 3 && (a < 0 ? -a : a) == 7);
    long c = L(-70000), d = L(3);
    CHECK((c < d ? c : d) == -70000 && (c > d ? c : d) == 3 && (c < 0 ? -c : c) == 70000);
}
TEST(saturating_pattern, "C11 6.5.15")
{
    long sum = (long)I(30000) + I(30000);
    int clipped = sum > INT_MAX ? INT_MAX : sum < INT_MIN ? INT_MIN : (int)sum;
    CHECK(clipped == INT_MAX);
}
