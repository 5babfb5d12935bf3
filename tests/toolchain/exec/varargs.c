/* Variable arguments and calling sequences. */
#include "exec.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static NOINLINE long sum_ints(int count, ...)
{
    va_list list;
    long sum = 0;
    va_start(list, count);
    while (count--)
        sum += va_arg(list, int);
    va_end(list);
    return sum;
}
TEST(ints, "C11 7.16.1.1") { CHECK(sum_ints(I(3), 1, -2, I(10)) == 9 && sum_ints(0) == 0 && sum_ints(1, 32767) == 32767); }
TEST(many_ints, "C11 7.16.1.1") { CHECK(sum_ints(12, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, I(12)) == 78); }
static NOINLINE int mixed(const char *kinds, ...)
{
    va_list list;
    int ok = 1;
    va_start(list, kinds);
    for (; *kinds; kinds++) {
        switch (*kinds) {
        case 'i': ok &= va_arg(list, int) == -5; break;
        case 'u': ok &= va_arg(list, unsigned) == 50000u; break;
        case 'l': ok &= va_arg(list, long) == -123456L; break;
        case 'q': ok &= va_arg(list, long long) == 0x123456789ABCll; break;
        case 'd': ok &= va_arg(list, double) == 2.5; break;
        case 's': ok &= strcmp(va_arg(list, const char *), "text") == 0; break;
        }
    }
    va_end(list);
    return ok;
}
TEST(mixed_types, "C11 7.16.1.1") { CHECK(mixed("iulqds", I(-5), U(50000u), L(-123456L), LL(0x123456789ABCll), D(2.5), "text")); }
TEST(mixed_types_other_order, "C11 7.16.1.1") { CHECK(mixed("dsiqul", 2.5, "text", -5, 0x123456789ABCll, 50000u, -123456L) && mixed("qiqiq", 0x123456789ABCll, -5, 0x123456789ABCll, -5, 0x123456789ABCll)); }
TEST(default_promotions, "C11 6.5.2.2p6") { CHECK(sum_ints(3, C(-1), UC(200), (short)7) == 206 && mixed("d", F(2.5f))); }
struct point { int x, y; };
static NOINLINE int points(int count, ...)
{
    va_list list;
    int sum = 0;
    va_start(list, count);
    while (count--) {
        struct point p = va_arg(list, struct point);
        sum += p.x * 10 + p.y;
    }
    va_end(list);
    return sum;
}
TEST(struct_arguments, "C11 7.16.1.1") { struct point a = {I(1), 2}, b = {3, I(4)}; CHECK(points(2, a, b) == 46); }
static NOINLINE long forwarded(int count, va_list list) { long sum = 0; while (count--) sum += va_arg(list, long); return sum; }
static NOINLINE long forward(int count, ...) { va_list list; va_start(list, count); long sum = forwarded(count, list); va_end(list); return sum; }
TEST(list_passed_on, "C11 7.16p3") { CHECK(forward(3, 100000L, L(200000L), -50000L) == 250000L); }
static NOINLINE int twice(int count, ...)
{
    va_list list, copy;
    int a = 0, b = 0;
    va_start(list, count);
    va_copy(copy, list);
    for (int i = 0; i < count; i++)
        a = a * 10 + va_arg(list, int);
    for (int i = 0; i < count; i++)
        b = b * 10 + va_arg(copy, int);
    va_end(copy);
    va_end(list);
    return a == b ? a : -1;
}
TEST(list_copied, "C11 7.16.1.2") { CHECK(twice(4, 1, 2, 3, I(4)) == 1234); }
static NOINLINE int named_first(char a, long b, unsigned char c, ...) { va_list list; va_start(list, c); int r = va_arg(list, int) + a + (int)b + c; va_end(list); return r; }
TEST(several_named_parameters, "abi-elf.md 2.2") { CHECK(named_first(C(-1), L(1000), UC(255), I(7)) == 1261); }
static NOINLINE long long wide_result(int n, ...) { va_list list; va_start(list, n); long long r = va_arg(list, long long) * n; va_end(list); return r; }
TEST(wide_result_of_variadic, "abi-elf.md 2.3") { CHECK(wide_result(3, LL(0x100000000ll)) == 0x300000000ll); }
static NOINLINE long (*pick(void))(int, ...) { return forward; }
TEST(variadic_through_pointer, "C11 6.5.2.2") { CHECK(pick()(2, 70000L, 1L) == 70001L); }
static NOINLINE long eight(int a, long b, int c, long d, int e, int f, int g) { return a + b * 2 + c * 3 + d * 4 + e * 5L + f * 6L + g * 7L; }
TEST(backfilled_arguments, "abi-elf.md 2.2") { CHECK(eight(I(1), L(2), I(3), L(4), I(5), I(6), I(7)) == 1 + 4 + 9 + 16 + 25 + 36 + 49); }
static NOINLINE int ten(int a, int b, int c, int d, int e, int f, int g, int h, int i, int j) { return a - b + c * d - e + f * g - h + i * 100 + j; }
TEST(stack_arguments, "abi-elf.md 2.2") { CHECK(ten(1, 2, 3, 4, 5, 6, 7, 8, I(9), I(10)) == 1 - 2 + 12 - 5 + 42 - 8 + 900 + 10); }
static NOINLINE long long wide_args(int a, long long b, int c, long long d, long e) { return a + b + c + d + e; }
TEST(wide_stack_arguments, "abi-elf.md 2.2") { CHECK(wide_args(I(1), LL(0x100000000ll), I(2), LL(0x200000000ll), L(-3)) == 0x300000000ll); }
static NOINLINE int chars(signed char a, unsigned char b, signed char c, unsigned char d) { return a + b * 2 + c * 3 + d; }
TEST(narrow_arguments_extend, "abi-elf.md 2.2") { CHECK(chars(C(-1), UC(255), C(-128), UC(128)) == -1 + 510 - 384 + 128 && chars((signed char)I(0x1FF), (unsigned char)I(0x100), 0, 0) == -1); }
static NOINLINE signed char narrow(int x) { return (signed char)x; }
static NOINLINE unsigned char narrow_u(int x) { return (unsigned char)x; }
static NOINLINE _Bool truth(long x) { return x != 0; }
TEST(narrow_results_extend, "abi-elf.md 2.3") { CHECK(narrow(I(0x180)) == -128 && narrow_u(I(0x1FF)) == 255 && truth(L(0x10000)) == 1 && truth(L(0)) == 0); }
static int total(); /* declared without prototype */
TEST(call_without_prototype, "C11 6.5.2.2p6") { CHECK(total(1, 2L, 'c') == 102); }
static int total(a, b, c) int a; long b; int c; { return a + (int)b + c; }
TEST(snprintf_integers, "C11 7.21.6.5") { char s[40]; CHECK(snprintf(s, sizeof s, "%d|%5d|%-5d|%05d|%+d|% d", I(-42), 7, 7, 7, 7, 7) == 27 && strcmp(s, "-42|    7|7    |00007|+7| 7") == 0); }
TEST(snprintf_unsigned_and_hex, "C11 7.21.6.1") { char s[40]; snprintf(s, sizeof s, "%u %x %X %o %#x %#o", U(65535u), U(0xBEEF), U(0xBEEF), U(8), U(255), U(8)); CHECK(strcmp(s, "65535 beef BEEF 10 0xff 010") == 0); }
TEST(snprintf_long, "C11 7.21.6.1") { char s[80]; snprintf(s, sizeof s, "%ld %lu %lx %lld %llu", L(-2147483647 - 1), UL(4294967295ul), UL(0xDEADBEEF), LL(-9007199254740993ll), ULL(18446744073709551615ull)); CHECK(strcmp(s, "-2147483648 4294967295 deadbeef -9007199254740993 18446744073709551615") == 0); }
TEST(snprintf_strings, "C11 7.21.6.1") { char s[40]; snprintf(s, sizeof s, "[%s][%8s][%-8s][%.2s][%c]%%", "abc", "abc", "abc", "abc", 'z'); CHECK(strcmp(s, "[abc][     abc][abc     ][ab][z]%") == 0); }
TEST(snprintf_precision, "C11 7.21.6.1p4") { char s[40]; snprintf(s, sizeof s, "%.3d|%8.3d|%-8.3d|%.0d|%*d|%.*d", 5, -5, 5, 0, 4, 1, 2, 3); CHECK(strcmp(s, "005|    -005|005     ||   1|03") == 0); }
TEST(snprintf_truncates, "C11 7.21.6.5p3") { char s[5] = "xxxx"; CHECK(snprintf(s, 4, "%d", 12345) == 5 && strcmp(s, "123") == 0 && s[4] == 0 && snprintf(s, 0, "abc") == 3 && s[0] == '1'); }
TEST(sprintf_into_buffer, "C11 7.21.6.6") { char s[16]; CHECK(sprintf(s, "%c%c%d", 'o', 'k', 9) == 3 && strcmp(s, "ok9") == 0); }
