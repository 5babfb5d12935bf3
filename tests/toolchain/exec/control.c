/* Statements: if, switch, loops, goto, comma, short circuit, recursion. */
#include "exec.h"

static NOINLINE int dense(int x)
{
    switch (x) {
    case 0: return 10;
    case 1: return 21;
    case 2: return 32;
    case 3: return 43;
    case 4: return 54;
    case 5: return 65;
    case 6: return 76;
    case 7: return 87;
    case 8: return 98;
    case 9: return 109;
    case 10: return 1110;
    case 11: return 2111;
    default: return -1;
    }
}
TEST(switch_dense, "C11 6.8.4.2p5") { CHECK(dense(I(0)) == 10 && dense(I(7)) == 87 && dense(I(11)) == 2111 && dense(I(12)) == -1 && dense(I(-1)) == -1 && dense(I(-32768L)) == -1); }
static NOINLINE int with_effects(int x)
{
    static int log;
    log = 0;
    switch (x) {
    case 0: log += 1; break;
    case 1: log += 2; /* fall through */
    case 2: log += 4; break;
    case 3: log += 8; /* fall through */
    case 4:
    case 5: log += 16; /* fall through */
    default: log += 32;
    case 6: log += 64; break;
    case 7: log = -log; break;
    case 8: log = 7; break;
    case 9: log = 8; break;
    case 10: log = 9; break;
    case 11: log = 11; break;
    }
    return log;
}
TEST(switch_fall_through, "C11 6.8.4.2p4") { CHECK(with_effects(I(0)) == 1 && with_effects(I(1)) == 6 && with_effects(I(2)) == 4 && with_effects(I(3)) == 120 && with_effects(I(5)) == 112 && with_effects(I(6)) == 64 && with_effects(I(99)) == 96 && with_effects(I(10)) == 9); }
static NOINLINE int sparse(int x)
{
    switch (x) {
    case -30000: return 1;
    case -1: return 2;
    case 0: return 3;
    case 100: return 4;
    case 1000: return 5;
    case 32767: return 6;
    }
    return 0;
}
TEST(switch_sparse, "C11 6.8.4.2") { CHECK(sparse(I(-30000)) == 1 && sparse(I(-1)) == 2 && sparse(I(0)) == 3 && sparse(I(100)) == 4 && sparse(I(1000)) == 5 && sparse(I(32767)) == 6 && sparse(I(7)) == 0); }
static NOINLINE int on_char(signed char c)
{
    switch (c) {
    case 'a': case 'e': case 'i': case 'o': case 'u': return 1;
    case -128: return 2;
    case 127: return 3;
    default: return 0;
    }
}
TEST(switch_on_char, "C11 6.8.4.2p5") { CHECK(on_char(C('a')) == 1 && on_char(C('u')) == 1 && on_char(C('b')) == 0 && on_char(C(-128)) == 2 && on_char(C(127)) == 3); }
static NOINLINE int on_long(long x)
{
    switch (x) {
    case 0x10000: return 1;
    case 0x20000: return 2;
    case 0: return 3;
    case -1: return 4;
    case 0x10001: return 5;
    default: return 0;
    }
}
TEST(switch_on_long, "C11 6.8.4.2p5") { CHECK(on_long(L(0x10000)) == 1 && on_long(L(0x20000)) == 2 && on_long(L(0)) == 3 && on_long(L(-1)) == 4 && on_long(L(0x10001)) == 5 && on_long(L(0x30000)) == 0); }
static NOINLINE int on_long_long(long long x)
{
    switch (x) {
    case 0x100000000ll: return 1;
    case 1: return 2;
    case -0x7FFFFFFFFFFFFFFFll: return 3;
    }
    return 0;
}
TEST(switch_on_long_long, "C11 6.8.4.2p5") { CHECK(on_long_long(LL(0x100000000ll)) == 1 && on_long_long(LL(1)) == 2 && on_long_long(LL(0)) == 0 && on_long_long(LL(-0x7FFFFFFFFFFFFFFFll)) == 3); }
static NOINLINE unsigned on_unsigned(unsigned x)
{
    switch (x) {
    case 65535u: return 1;
    case 32768u: return 2;
    case 65534u: return 3;
    case 65533u: return 4;
    case 65532u: return 5;
    default: return 0;
    }
}
TEST(switch_on_unsigned, "C11 6.8.4.2p5") { CHECK(on_unsigned(U(65535u)) == 1 && on_unsigned(U(32768u)) == 2 && on_unsigned(U(65532u)) == 5 && on_unsigned(U(0)) == 0); }
static NOINLINE int range(int x)
{
    switch (x) {
    case 'a' ... 'z': return 1;
    case '0' ... '9': return 2;
    default: return 0;
    }
}
TEST(switch_case_ranges, "GNU C") { CHECK(range(I('m')) == 1 && range(I('z')) == 1 && range(I('0')) == 2 && range(I('A')) == 0); }
static NOINLINE const char *name_of(int day)
{
    switch (day) {
    case 0: return "mon";
    case 1: return "tue";
    case 2: return "wed";
    case 3: return "thu";
    case 4: return "fri";
    }
    return "?";
}
TEST(switch_of_strings, "C11 6.8.4.2") { CHECK(name_of(I(0))[0] == 'm' && name_of(I(4))[1] == 'r' && name_of(I(5))[0] == '?'); }
TEST(switch_inside_loop, "C11 6.8.6.3")
{
    int state = 0, steps = 0;
    for (;;) {
        switch (state) {
        case 0: state = 2; break;
        case 1: state = 3; continue;
        case 2: state = 1; break;
        case 3: goto done;
        }
        if (++steps > 10)
            break;
    }
done:
    CHECK(state == 3 && steps == 2);
}
TEST(duffs_device, "C11 6.8.4.2")
{
    char from[11] = "0123456789", to[11] = {0}, *s = from, *d = to;
    int count = I(10), n = (count + 3) / 4;
    switch (count % 4) {
    case 0: do { *d++ = *s++; /* fall through */
    case 3: *d++ = *s++; /* fall through */
    case 2: *d++ = *s++; /* fall through */
    case 1: *d++ = *s++;
            } while (--n > 0);
    }
    CHECK(to[0] == '0' && to[9] == '9' && to[10] == 0);
}
TEST(for_loop, "C11 6.8.5.3") { int sum = 0; for (int i = 0; i < I(100); i++) sum += i; CHECK(sum == 4950); }
TEST(for_loop_counting_down, "C11 6.8.5.3") { int sum = 0; for (unsigned i = U(10); i-- > 0;) sum += (int)i; CHECK(sum == 45); }
TEST(while_loop_not_entered, "C11 6.8.5.1") { int n = I(0), count = 0; while (n) { count++; n--; } CHECK(count == 0); }
TEST(do_loop_runs_once, "C11 6.8.5.2") { int n = I(0), count = 0; do count++; while (n); CHECK(count == 1); }
TEST(nested_break_and_continue, "C11 6.8.6.2-3")
{
    int hits = 0;
    for (int i = 0; i < I(10); i++) {
        if (i % 2)
            continue;
        for (int j = 0;; j++) {
            if (j > i)
                break;
            hits++;
        }
    }
    CHECK(hits == 1 + 3 + 5 + 7 + 9);
}
TEST(long_loop_counter, "C11 6.8.5.3") { long n = 0; for (long i = L(65530); i < L(65545); i++) n += i & 1; CHECK(n == 7); }
TEST(unsigned_char_counter_wraps, "C11 6.2.5p9") { int n = 0; for (unsigned char i = UC(250); i != 5; i++) n++; CHECK(n == 11); }
TEST(goto_backward_and_out, "C11 6.8.6.1")
{
    int i = I(0);
again:
    i++;
    for (int j = 0; j < 3; j++)
        if (i < 4)
            goto again;
        else if (j == 2)
            goto out;
    i = -1;
out:
    CHECK(i == 4);
}
TEST(computed_goto, "GNU C")
{
    static const void *const table[] = {&&a, &&b, &&c};
    int trace = 0, step = I(0);
next:
    goto *table[step];
a:
    trace = trace * 10 + 1;
    step = 2;
    goto next;
b:
    trace = trace * 10 + 2;
    CHECK(trace == 132);
    return;
c:
    trace = trace * 10 + 3;
    step = 1;
    goto next;
}
static int calls;
static NOINLINE int counted(int value) { calls++; return value; }
TEST(short_circuit_and, "C11 6.5.13p4") { calls = 0; int r = counted(I(0)) && counted(1); CHECK(r == 0 && calls == 1); r = counted(I(1)) && counted(I(7)); CHECK(r == 1 && calls == 3); }
TEST(short_circuit_or, "C11 6.5.14p4") { calls = 0; int r = counted(I(3)) || counted(1); CHECK(r == 1 && calls == 1); r = counted(I(0)) || counted(I(0)); CHECK(r == 0 && calls == 3); }
TEST(conditional_evaluates_one_side, "C11 6.5.15p4") { calls = 0; int r = I(1) ? 5 : counted(6); CHECK(r == 5 && calls == 0); r = I(0) ? counted(5) : 6; CHECK(r == 6 && calls == 0); }
TEST(comma_operator, "C11 6.5.17p2") { int a = I(1), b; b = (a += 2, a * 10); CHECK(a == 3 && b == 30); }
TEST(else_if_chain, "C11 6.8.4.1") { int x = I(42), r; if (x < 10) r = 1; else if (x < 40) r = 2; else if (x < 50) r = 3; else r = 4; CHECK(r == 3); }
TEST(dangling_else, "C11 6.8.4.1p3") { int r = 0; if (I(1)) if (I(0)) r = 1; else r = 2; CHECK(r == 2); }
static NOINLINE unsigned long factorial(unsigned n) { return n < 2 ? 1 : n * factorial(n - 1); }
TEST(recursion_factorial, "C11 6.5.2.2p11") { CHECK(factorial(U(12)) == 479001600ul); }
static NOINLINE int fibonacci(int n) { return n < 2 ? n : fibonacci(n - 1) + fibonacci(n - 2); }
TEST(recursion_fibonacci, "C11 6.5.2.2p11") { CHECK(fibonacci(I(15)) == 610); }
static NOINLINE int ackermann(int m, int n) { return m == 0 ? n + 1 : n == 0 ? ackermann(m - 1, 1) : ackermann(m - 1, ackermann(m, n - 1)); }
TEST(recursion_ackermann, "C11 6.5.2.2p11") { CHECK(ackermann(I(2), I(4)) == 11); }
static NOINLINE int is_odd(unsigned n);
static NOINLINE int is_even(unsigned n) { return n == 0 ? 1 : is_odd(n - 1); }
static NOINLINE int is_odd(unsigned n) { return n == 0 ? 0 : is_even(n - 1); }
TEST(mutual_recursion, "C11 6.5.2.2p11") { CHECK(is_even(U(100)) == 1 && is_odd(U(51)) == 1 && is_even(U(7)) == 0); }
static NOINLINE int hanoi(int n, int from, int to, int via) { return n == 0 ? 0 : hanoi(n - 1, from, via, to) + 1 + hanoi(n - 1, via, to, from); }
TEST(recursion_hanoi, "C11 6.5.2.2p11") { CHECK(hanoi(I(7), 1, 3, 2) == 127); }
static NOINLINE void permute(char *s, int k, int n, unsigned *hash)
{
    if (k == n) {
        for (int i = 0; i < n; i++)
            *hash = *hash * 31 + (unsigned)s[i];
        return;
    }
    for (int i = k; i < n; i++) {
        char t = s[k]; s[k] = s[i]; s[i] = t;
        permute(s, k + 1, n, hash);
        t = s[k]; s[k] = s[i]; s[i] = t;
    }
}
TEST(recursion_with_state, "C11 6.5.2.2p11")
{
    char s[] = "abcd";
    unsigned hash = 0;
    permute(s, 0, I(4), &hash);
    CHECK(s[0] == 'a' && s[3] == 'd' && hash == 0x8000u);
}
static NOINLINE int quick(int *v, int low, int high)
{
    int swaps = 0;
    while (low < high) {
        int pivot = v[(low + high) / 2], i = low, j = high;
        while (i <= j) {
            while (v[i] < pivot) i++;
            while (v[j] > pivot) j--;
            if (i <= j) { int t = v[i]; v[i] = v[j]; v[j] = t; i++; j--; swaps++; }
        }
        swaps += quick(v, low, j);
        low = i;
    }
    return swaps;
}
TEST(quicksort, "C11 6.5.2.2p11")
{
    int v[20];
    unsigned seed = U(12345);
    for (int i = 0; i < 20; i++) {
        seed = seed * 25173u + 13849u;
        v[i] = (int)(seed >> 3) - 4000;
    }
    quick(v, 0, 19);
    for (int i = 1; i < 20; i++)
        CHECK(v[i - 1] <= v[i]);
}
TEST(variable_length_array, "C11 6.7.6.2p4")
{
    int n = I(9);
    long v[n];
    for (int i = 0; i < n; i++)
        v[i] = i * 1000L;
    CHECK(v[8] == 8000 && sizeof v == 36);
}
TEST(statement_expression, "GNU C") { int x = ({ int t = I(3); t * t; }); CHECK(x == 9); }
TEST(block_scope_hides, "C11 6.2.1p4") { int x = I(1); { int x = I(2); CHECK(x == 2); } CHECK(x == 1); }
