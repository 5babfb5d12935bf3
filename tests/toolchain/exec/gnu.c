/* GNU C that firmware and GCC's own tests use: vectors, frames, non-local jumps without a library, labels as values. */
#include "exec.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

typedef int v4 __attribute__((vector_size(8)));
typedef unsigned char v32b __attribute__((vector_size(32)));
typedef unsigned v16u __attribute__((vector_size(32)));
typedef unsigned long long v4q __attribute__((vector_size(32)));

static NOINLINE v4 add4(v4 a, v4 b) { return a + b * I(2); }
TEST(vector_in_registers, "GCC 6.52") { v4 r = add4((v4){1, 2, 3, I(4)}, (v4){10, 20, 30, I(-40)}); CHECK(r[0] == 21 && r[1] == 42 && r[2] == 63 && r[3] == -76); }
static NOINLINE v16u wide(v4q x, unsigned at) { v16u r = (v16u)x; r[at & 15] += 7; return r; }
TEST(vector_wider_than_the_registers, "GCC 6.52")
{
    v16u r = wide((v4q){0x0001000200030004ull, 5, ULL(6), 0xFFFFull << 48}, U(15));
    CHECK(r[0] == 4 && r[1] == 3 && r[2] == 2 && r[3] == 1 && r[4] == 5 && r[8] == 6 && r[15] == 6);
}
TEST(vector_lanes_regrouped, "GCC 6.52")
{
    v16u from;
    for (unsigned k = 0; k < 16; k++)
        from[k] = U(k * 257 + 1);
    v32b bytes = (v32b)from;
    v4q quads = (v4q)bytes;
    CHECK(bytes[0] == 1 && bytes[1] == 0 && bytes[30] == 16 && bytes[31] == 15 && (unsigned)quads[3] == 12 * 257 + 1);
}

static void *volatile entered_from;
static NOINLINE void note(void) { entered_from = __builtin_return_address(0); }
TEST(return_address, "GCC 6.49") { note(); void *first = entered_from; note(); CHECK(first != entered_from); }
TEST(frame_address, "GCC 6.49") { char here; char *frame = __builtin_frame_address(0); CHECK(frame - &here < 200 && &here - frame < 200); }

static void *escape[5];
static NOINLINE void leap(void) { __builtin_longjmp(escape, 1); }
TEST(builtin_setjmp, "GCC 6.5") { volatile int n = 1; if (__builtin_setjmp(escape) == 0) { n = 2; leap(); n = 3; } CHECK(n == 2); }

TEST(labels_as_values, "GCC 6.3") { static const void *const next[] = {&&one, &&two}; int n = 0; goto *next[I(1)]; one: n += 1; two: n += 2; CHECK(n == 2); }
TEST(statement_expression, "GCC 6.1") { int r = ({ int t = I(3); t * t; }); CHECK(r == 9); }
TEST(case_ranges, "GCC 6.30") { int r = 0; switch (I(5)) { case 1 ... 4: r = 1; break; case 5 ... 9: r = 2; } CHECK(r == 2); }
TEST(infinity_and_nan_builtins, "GCC 6.59") { CHECK(__builtin_isinff(F(1e30f) * 1e30f) && __builtin_isnanf(F(0) / F(0)) && !__builtin_isinfl(D(1))); }

/* The library's memmove must not call a memcpy that the program replaces; this counts its calls. */
static volatile int copies;
void *memcpy(void *restrict to, const void *restrict from, size_t n) { char *t = to; const char *f = from; copies++; while (n--) *t++ = *f++; return to; }
TEST(own_memcpy_beside_memmove, "C11 7.24.2.2") { static char s[] = "abcdef"; copies = 0; memmove(s, s + 1, U(5)); CHECK(copies == 0 && strcmp(s, "bcdeff") == 0); memcpy(s, "xy", U(2)); CHECK(copies == 1 && s[0] == 'x'); }
TEST(printing_to_streams, "C11 7.21.6.1") { CHECK(fprintf(stdout, "%s", "") == 0 && fputs("", stderr) == 0 && fflush(stdout) == 0); }
static NOINLINE int first_of(const int *p) { const int *q = __builtin_assume_aligned(p, 8); __builtin_assume(q[1] > 3); return q[0]; }
TEST(assumed_alignment, "GCC 6.59") { static const int pair[] __attribute__((aligned(8))) = {7, 9}; CHECK(first_of(pair) == 7 && __builtin_assume_aligned(pair + I(1), 8, 2) == pair + 1); }
