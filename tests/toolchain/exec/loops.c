/* Loops with n iterations for every n, and divisions by constants for operands of every kind. */
#include "exec.h"

static int a[40], b[40];

NOINLINE int above(const int *p, int n, int t) { int c = 0; for (int i = 0; i < n; i++) if (p[i] > t) c++; return c; }
NOINLINE void clear(int *p, int n) { for (int i = 0; i < n; i++) p[i] = 0; }
NOINLINE long sum(const int *x, int n) { long s = 0; for (int i = 0; i < n; i++) s += x[i]; return s; }
NOINLINE int nested(int n, int m) { int s = 0; for (int i = 0; i < n; i++) for (int j = 0; j < m; j++) s += i ^ j; return s; }
NOINLINE int down(int n) { int s = 0; for (int i = n; i > 0; i--) s += i; return s; }

TEST(trip_counts, "6.8.5: no turn at all for n <= 0")
{
    static const int counts[] = {0, -1, -32767 - 1, 1, 5, 40, -5};
    for (int i = 0; i < 40; i++)
        a[i] = i;
    for (int k = 0; k < 7; k++) {
        int n = counts[k], turns = n < 0 ? 0 : n, left = 0;
        CHECK(above(a, n, 3) == (turns > 4 ? turns - 4 : 0));
        CHECK(sum(a, n) == (long)turns * (turns - 1) / 2 && down(n) == turns * (turns + 1) / 2);
        for (int i = 0; i < 40; i++)
            b[i] = 1;
        clear(b, n);
        for (int i = 0; i < 40; i++)
            left += b[i];
        CHECK(left == 40 - turns);
        CHECK((nested(n, 3) == 0) == (turns == 0) && (nested(3, n) == 0) == (turns == 0));
    }
}

NOINLINE int from_one(const int *p, int n) { int s = 0; for (int i = 1; i < n; i++) s += p[i]; return s; }
NOINLINE int indexed(const int *p, int n) { int s = 0; for (int i = 1; i < n; i++) s += p[i] * i; return s; }
NOINLINE void both(const int *p, int n, int *lo, int *hi)
{
    int least = p[0], most = p[0];
    for (int i = 1; i < n; i++) {
        if (p[i] < least)
            least = p[i];
        if (p[i] > most)
            most = p[i];
    }
    *lo = least;
    *hi = most;
}
NOINLINE int length(const char *s) { int n = 0; while (*s++) n++; return n; }
NOINLINE int place(const int *p, int n, int key)
{
    int lo = 0, hi = n - 1;
    while (lo <= hi) {
        int m = (lo + hi) / 2;
        if (p[m] == key)
            return m;
        if (p[m] < key)
            lo = m + 1;
        else
            hi = m - 1;
    }
    return -1;
}

TEST(loops_from_one, "6.8.5: no turn at all for n <= 1, whatever n")
{
    static const int counts[] = {1, 0, -1, -32767 - 1, -32767, 2, 40, 7};
    for (int i = 0; i < 40; i++)
        a[i] = (i * 7) % 40 - 11;
    for (int k = 0; k < 8; k++) {
        int n = counts[k], s = 0, weighted = 0, least = a[0], most = a[0], lo, hi;
        for (volatile int i = 1; i < n; i++) {
            int x = a[i];
            s += x;
            weighted += x * i;
            least = x < least ? x : least;
            most = x > most ? x : most;
        }
        CHECK(from_one(a, n) == s && indexed(a, n) == weighted);
        both(a, n, &lo, &hi);
        CHECK(lo == least && hi == most);
    }
    CHECK(length("") == 0 && length("a") == 1 && length("seventeen letters") == 17);
    for (int i = 0; i < 40; i++)
        a[i] = 3 * i;
    for (int i = 0; i < 40; i++)
        CHECK(place(a, 40, 3 * i) == i && place(a, 40, 3 * i + 1) == -1);
}

NOINLINE int eighth(int x, int *r) { *r = x % 8; return x / 8; }
NOINLINE int half(int x, int *r) { *r = x % 2; return x / 2; }
NOINLINE int minus_seventh(int x, int *r) { *r = x % -7; return x / -7; }
NOINLINE int minus_sixteenth(int x, int *r) { *r = x % -16; return x / -16; }

TEST(signed_division_by_powers_and_negative_numbers, "6.5.5p6: quotients go towards zero")
{
    static const struct { int d; int (*f)(int, int *); } forms[] = {{8, eighth}, {2, half}, {-7, minus_seventh}, {-16, minus_sixteenth}};
    for (int k = 0; k < 4; k++)
        for (long x = -32768; x < 32768; x += 2731 - (x & 7)) {
            int r, q = forms[k].f((int)x, &r);
            CHECK((long)q * forms[k].d + r == x && (r < 0 ? -r : r) < (forms[k].d < 0 ? -forms[k].d : forms[k].d));
            CHECK(r == 0 || (r < 0) == (x < 0));
        }
}

NOINLINE unsigned crc_right(const unsigned char *p, int n)
{
    unsigned c = 0xFFFF;
    while (n--) {
        c ^= *p++;
        for (int k = 0; k < 8; k++)
            c = (c & 1) ? (c >> 1) ^ 0xA001 : c >> 1;
    }
    return c;
}
NOINLINE unsigned crc_left(const unsigned char *p, int n)
{
    unsigned c = 0xFFFF;
    while (n--) {
        c ^= (unsigned)*p++ << 8;
        for (int k = 0; k < 8; k++)
            c = c & 0x8000 ? c << 1 ^ 0x1021 : c << 1;
    }
    return c;
}
NOINLINE unsigned long crc_long(const unsigned char *p, int n)
{
    unsigned long c = 0xFFFFFFFFul;
    while (n--) {
        c ^= *p++;
        for (int k = 0; k < 8; k++)
            c = c & 1 ? c >> 1 ^ 0xEDB88320ul : c >> 1;
    }
    return ~c;
}

TEST(cyclic_redundancy_checks, "check values of CRC-16/MODBUS, CRC-16/CCITT-FALSE and CRC-32 over 123456789")
{
    static const unsigned char digits[] = "123456789";
    CHECK(crc_right(digits, 9) == 0x4B37);
    CHECK(crc_left(digits, 9) == 0x29B1);
    CHECK(crc_long(digits, 9) == 0xCBF43926ul);
}

#define DIVISORS(X) X(3) X(5) X(6) X(7) X(9) X(10) X(11) X(12) X(60) X(100) X(255) X(641) X(1000) X(10000) X(32767)
#define DIVIDE(d)                                                                                     \
    NOINLINE unsigned by_##d(unsigned x, unsigned *r) { *r = x % d##u; return x / d##u; }             \
    NOINLINE int signed_##d(int x, int *r) { *r = x % d; return x / d; }
DIVISORS(DIVIDE)
#define ROW(d) {d, by_##d, signed_##d},
static const struct { unsigned d; unsigned (*u)(unsigned, unsigned *); int (*s)(int, int *); } rows[] = {DIVISORS(ROW)};

TEST(division_by_constants, "6.5.5p6: (a/b)*b + a%b equals a")
{
    for (unsigned k = 0; k < sizeof rows / sizeof *rows; k++) {
        unsigned d = rows[k].d, x = 0;
        for (unsigned n = 0; n < 60; n++) {
            unsigned r, q = rows[k].u(x, &r);
            CHECK(r < d && q * (unsigned long)d + r == x);
            int rs, qs = rows[k].s((int)x, &rs);
            CHECK((long)qs * (long)d + rs == (int)x && (rs < 0 ? -rs : rs) < (int)d);
            CHECK(rs == 0 || (rs < 0) == ((int)x < 0));
            x = n < 20 ? d * n + (n & 1 ? ~0u : 0u) : n == 40 ? 0x7FFFu : n == 41 ? 0x8000u : n == 42 ? ~0u : x * 25173u + 13849u;
        }
    }
}
