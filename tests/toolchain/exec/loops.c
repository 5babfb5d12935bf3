/* Loops that run n times for every n, and divisions by constants for every kind of operand. */
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
