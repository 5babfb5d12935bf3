/* 64-bit integers: arithmetic, comparison, shifts, conversion. */
#include "exec.h"

#include <limits.h>

TEST(add_64, "C11 6.5.6p5") { CHECK(LL(0xFFFFFFFFll) + LL(1) == 0x100000000ll && ULL(0xFFFFFFFFFFFFFFFF) + ULL(1) == 0 && LL(-5) + LL(3) == -2); }
TEST(subtract_64, "C11 6.5.6p6") { CHECK(LL(0x100000000ll) - LL(1) == 0xFFFFFFFFll && LL(0) - LL(1) == -1 && ULL(0) - ULL(1) == ULLONG_MAX); }
TEST(multiply_64, "C11 6.5.5p4") { CHECK(LL(1000000007ll) * LL(998244353ll) == 998244359987710471ll && LL(-3) * LL(0x100000001ll) == -0x300000003ll); }
TEST(multiply_64_wraps, "C11 6.2.5p9") { CHECK(ULL(0xFFFFFFFFFFFFFFFF) * ULL(0xFFFFFFFFFFFFFFFF) == 1 && ULL(0x123456789ABCDEF1) * ULL(0xFEDCBA987654321) == 0x3224A4396CC6D011ull); }
TEST(multiply_32_to_64, "C11 6.3.1.8p1") { CHECK((long long)L(-2147483647 - 1) * L(-2147483647 - 1) == 0x4000000000000000ll && (unsigned long long)UL(0xFFFFFFFF) * UL(0xFFFFFFFF) == 0xFFFFFFFE00000001ull && (long long)L(-70000) * L(70000) == -4900000000ll); }
TEST(multiply_16_to_64, "C11 6.3.1.8p1") { CHECK((long long)I(-300) * I(300) == -90000ll && (unsigned long long)U(65535) * U(65535) == 4294836225ull); }
TEST(divide_64, "C11 6.5.5p6") { CHECK(LL(1000000000000ll) / LL(7) == 142857142857ll && LL(1000000000000ll) % LL(7) == 1 && LL(-1000000000000ll) / LL(7) == -142857142857ll && LL(-1000000000000ll) % LL(7) == -1); }
TEST(divide_64_wide_divisor, "C11 6.5.5p6") { CHECK(ULL(0xFFFFFFFFFFFFFFFF) / ULL(0x100000001) == 0xFFFFFFFFull && ULL(0xFFFFFFFFFFFFFFFF) % ULL(0x100000000) == 0xFFFFFFFFull && ULL(5) / ULL(0x8000000000000000) == 0); }
TEST(divide_64_top_bit_divisor, "C11 6.5.5p5") { CHECK(ULL(0xFFFFFFFFFFFFFFFF) / ULL(0x8000000000000001) == 1 && ULL(0xFFFFFFFFFFFFFFFF) % ULL(0x8000000000000001) == 0x7FFFFFFFFFFFFFFEull); }
TEST(divide_64_by_constants, "C11 6.5.5p6") { CHECK(LL(123456789012345ll) / 10 == 12345678901234ll && LL(123456789012345ll) % 10 == 5 && LL(-9) / 4 == -2 && LL(-9) % 4 == -1 && ULL(0x8000000000000000) / 16 == 0x800000000000000ull); }
TEST(division_identity_64, "C11 6.5.5p6")
{
    static const long long values[] = {1, -1, 10, -65537, 0x100000000ll, -0x123456789ABCDEFll, 0x7FFFFFFFFFFFFFFFll, 999999999999ll};
    for (unsigned i = 0; i < 8; i++)
        for (unsigned j = 0; j < 8; j++)
            CHECK(values[i] / values[j] * values[j] + values[i] % values[j] == values[i]);
}
TEST(compare_64, "C11 6.5.8p6") { CHECK(LL(-1) < LL(0) && LL(0x100000000ll) > LL(0xFFFFFFFFll) && ULL(0x8000000000000000) > ULL(0x7FFFFFFFFFFFFFFF) && LL(5) <= LL(5) && LL(5) >= LL(5)); }
TEST(equality_64, "C11 6.5.9p3") { CHECK(LL(0x1000000000000ll) != LL(0) && LL(0x123456789ABCDEFll) == LL(0x123456789ABCDEFll) && !(ULL(1) == ULL(0x100000001))); }
TEST(bitwise_64, "C11 6.5.10-12") { CHECK((ULL(0xFF00FF00FF00FF00) & ULL(0x0FF00FF00FF00FF0)) == 0x0F000F000F000F00ull && (ULL(0xF0) | ULL(0xF000000000000000)) == 0xF0000000000000F0ull && (ULL(0xAAAAAAAAAAAAAAAA) ^ ULL(0xFFFFFFFFFFFFFFFF)) == 0x5555555555555555ull); }
TEST(negate_and_complement_64, "C11 6.5.3.3") { CHECK(-LL(0x100000000ll) == -0x100000000ll && ~ULL(0) == ULLONG_MAX && -LL(1) == -1); }
TEST(boolean_of_64, "C11 6.5.3.3p5") { CHECK(!!LL(0x1000000000000ll) == 1 && !LL(0) == 1 && (LL(0x80000000ll) ? 1 : 0)); }
TEST(conversions_between_32_and_64, "C11 6.3.1.3") { CHECK((long)LL(0x1122334455667788ll) == 0x55667788L && (long long)L(-5) == -5 && (unsigned long long)L(-1) == ULLONG_MAX && (long long)UL(0x80000000) == 2147483648ll); }
static NOINLINE long long select_64(int which, long long a, long long b) { return which ? a : b; }
TEST(arguments_and_results_64, "abi-elf.md 2.2") { CHECK(select_64(I(1), 0x123456789ll, -1) == 0x123456789ll && select_64(I(0), 1, -0x123456789ll) == -0x123456789ll); }
static NOINLINE unsigned long long gcd(unsigned long long a, unsigned long long b) { while (b) { unsigned long long t = a % b; a = b; b = t; } return a; }
TEST(gcd_64, "C11 6.5.5") { CHECK(gcd(ULL(1000000007ull * 12), ULL(1000000007ull * 18)) == 1000000007ull * 6); }
static NOINLINE unsigned long long power_mod(unsigned long long base, unsigned e, unsigned long m) { unsigned long long r = 1; for (base %= m; e; e >>= 1) { if (e & 1) r = r * base % m; base = base * base % m; } return r; }
TEST(modular_power, "C11 6.5.5") { CHECK(power_mod(ULL(3), U(200), UL(1000003)) == 333986ull && power_mod(ULL(2), U(10), UL(1000003)) == 1024); }
TEST(increment_through_pointer_64, "C11 6.5.2.4") { long long v = LL(0xFFFFFFFFFFFFll); long long *volatile p = &v; (*p)++; ++*p; CHECK(v == 0x1000000000001ll); *p -= 2; CHECK(v == 0xFFFFFFFFFFFFll); }
TEST(array_of_64, "C11 6.5.2.1") { long long a[4]; for (int i = 0; i < 4; i++) a[i] = (long long)i << 40; CHECK(a[I(3)] == 3ll << 40 && a[I(1)] + a[2] == a[3]); }
TEST(fnv_hash, "C11 6.2.5p9") { unsigned long long h = 0xCBF29CE484222325ull; for (const char *p = "foobar"; *p; p++) { h ^= (unsigned char)*p; h *= 0x100000001B3ull; } CHECK(h == 0x85944171F73967E8ull); }
TEST(xorshift_sequence, "C11 6.5.7") { unsigned long long x = ULL(88172645463325252ull); for (int i = 0; i < 3; i++) { x ^= x << 13; x ^= x >> 7; x ^= x << 17; } CHECK(x == 0x2FEF107A27529AD0ull); }

/* Defines functions that divide by a constant, for which the compiler may replace DIV by multiplications. */
#define DIVIDED_BY(name, d) \
    NOINLINE unsigned long u_##name(unsigned long x, unsigned long *r) { *r = x % (d); return x / (d); } \
    NOINLINE long s_##name(long x, long *r) { *r = x % (long)(d); return x / (long)(d); }
DIVIDED_BY(2, 2ul)
DIVIDED_BY(3, 3ul)
DIVIDED_BY(7, 7ul)
DIVIDED_BY(8, 8ul)
DIVIDED_BY(10, 10ul)
DIVIDED_BY(1000, 1000ul)
DIVIDED_BY(4096, 4096ul)
DIVIDED_BY(65537, 65537ul)
DIVIDED_BY(131072, 131072ul)
DIVIDED_BY(billion, 1000000007ul)
DIVIDED_BY(largest, 0x7FFFFFFFul)
DIVIDED_BY(minus_10, -10L)
DIVIDED_BY(minus_64, -64L)

TEST(divide_32_by_constants, "C11 6.5.5p6")
{
    static const struct {
        unsigned long d;
        unsigned long (*u)(unsigned long, unsigned long *);
        long (*s)(long, long *);
    } forms[] = {
        {2, u_2, s_2}, {3, u_3, s_3}, {7, u_7, s_7}, {8, u_8, s_8}, {10, u_10, s_10}, {1000, u_1000, s_1000},
        {4096, u_4096, s_4096}, {65537, u_65537, s_65537}, {131072, u_131072, s_131072},
        {1000000007, u_billion, s_billion}, {0x7FFFFFFF, u_largest, s_largest}, {-10, u_minus_10, s_minus_10},
        {-64, u_minus_64, s_minus_64}};
    static const unsigned long edges[] = {0, 1, 0x7FFF, 0x8000, 0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000, 0x80000001, 0xFFFFFFFF};
    for (unsigned k = 0; k < sizeof forms / sizeof *forms; k++) {
        volatile unsigned long d = forms[k].d;
        unsigned long x = 0x12345678;
        for (int n = 0; n < 60; n++) {
            x = n < 10 ? edges[n] : n < 20 ? d * (unsigned)n - 1 : n < 30 ? d * (unsigned)n : x * 1664525ul + 1013904223ul;
            unsigned long ur;
            long sr;
            CHECK(forms[k].u(x, &ur) == x / d && ur == x % d);
            CHECK(forms[k].s((long)x, &sr) == (long)x / (long)d && sr == (long)x % (long)d);
        }
    }
}

/* Two 64-bit selections by one condition, with more live values than registers. */
static NOINLINE long long first_above(const long long *sorted, long long count, long long wanted)
{
    long long low = 0, high = count;
    while (low < high) {
        long long middle = (low + high) / 2;
        if (sorted[middle] <= wanted)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static NOINLINE void both(long long a, long long b, long long *more, long long *less)
{
    long long x = a < b ? a : b, y = a < b ? b : a, d = a < b ? y - x : b;
    *less = x ^ d;
    *more = y;
}

TEST(bisect_among_64_bits, "C11 6.5.15p4")
{
    static const long long sorted[] = {-0x7000000000000000, -5000000000, -1, 0, 3, 70000, 5000000000, 0x7000000000000000};
    enum { COUNT = sizeof sorted / sizeof *sorted };
    for (int k = 0; k < COUNT; k++) {
        CHECK(first_above(sorted, LL(COUNT), LL(sorted[k])) == k + 1);
        CHECK(first_above(sorted, LL(COUNT), LL(sorted[k] - 1)) == k);
        for (int n = 0; n < COUNT; n++) {
            long long more, less;
            both(LL(sorted[k]), LL(sorted[n]), &more, &less);
            CHECK(more == sorted[k > n ? k : n]);
            CHECK(less == (sorted[k < n ? k : n] ^ (k < n ? more - sorted[k] : sorted[n])));
        }
    }
}
