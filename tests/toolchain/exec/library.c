/* Functions of string.h, ctype.h, stdlib.h and setjmp.h. */
#include "exec.h"

#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

TEST(memcpy_every_alignment, "C11 7.24.2.1")
{
    unsigned char from[24], to[24];
    for (unsigned i = 0; i < sizeof from; i++)
        from[i] = (unsigned char)(i * 7 + 1);
    for (unsigned a = 0; a < 3; a++)
        for (unsigned b = 0; b < 3; b++)
            for (unsigned n = 0; n < 9; n++) {
                memset(to, 0xEE, sizeof to);
                CHECK(memcpy(to + a, from + b, U(n)) == to + a);
                for (unsigned i = 0; i < sizeof to; i++)
                    CHECK(to[i] == (i >= a && i < a + n ? from[i - a + b] : 0xEE));
            }
}
TEST(memset_every_alignment, "C11 7.24.6.1")
{
    unsigned char to[16];
    for (unsigned a = 0; a < 3; a++)
        for (unsigned n = 0; n < 10; n++) {
            for (unsigned i = 0; i < sizeof to; i++)
                to[i] = 1;
            memset(to + a, I(0x1AB), U(n));
            for (unsigned i = 0; i < sizeof to; i++)
                CHECK(to[i] == (i >= a && i < a + n ? 0xAB : 1));
        }
}
TEST(memmove_overlaps, "C11 7.24.2.2")
{
    char s[] = "0123456789";
    memmove(s + 2, s, U(5));
    CHECK(strcmp(s, "0101234789") == 0);
    memmove(s, s + 3, U(6));
    CHECK(strcmp(s, "1234784789") == 0);
    memmove(s + 1, s, U(4));
    CHECK(memcmp(s, "11234", 5) == 0);
}
TEST(memcmp_signs, "C11 7.24.4.1") { CHECK(memcmp("abc", "abd", U(3)) < 0 && memcmp("\xff", "\x01", U(1)) > 0 && memcmp("abc", "abd", U(2)) == 0 && memcmp("a", "b", U(0)) == 0); }
TEST(memchr_finds, "C11 7.24.5.1") { const char *s = "hello"; CHECK(memchr(s, 'l', U(5)) == s + 2 && memchr(s, 'z', U(5)) == 0 && memchr(s, 'o', U(4)) == 0); }
TEST(strlen_and_strcpy, "C11 7.24.2.3") { char s[12]; CHECK(strlen("") == 0 && strlen("hello") == 5 && strcpy(s, "copy me") == s && strcmp(s, "copy me") == 0); }
TEST(strcmp_orders, "C11 7.24.4.2") { CHECK(strcmp("a", "b") < 0 && strcmp("b", "a") > 0 && strcmp("ab", "a") > 0 && strcmp("", "") == 0 && strcmp("\x80", "\x7f") > 0); }
TEST(strncmp_limits, "C11 7.24.4.4") { CHECK(strncmp("abcd", "abxy", U(2)) == 0 && strncmp("abcd", "abxy", U(3)) < 0 && strncmp("a", "b", U(0)) == 0 && strncmp("ab", "ab", U(9)) == 0); }
TEST(strncpy_pads, "C11 7.24.2.4") { char s[6] = "xxxxx"; strncpy(s, "ab", U(4)); CHECK(s[0] == 'a' && s[2] == 0 && s[3] == 0 && s[4] == 'x'); strncpy(s, "abcdef", U(3)); CHECK(s[2] == 'c' && s[3] == 0); }
TEST(strcat_and_strncat, "C11 7.24.3") { char s[16] = "ab"; strcat(s, "cd"); strncat(s, "efgh", U(2)); CHECK(strcmp(s, "abcdef") == 0); }
TEST(strchr_and_strrchr, "C11 7.24.5.2") { const char *s = "banana"; CHECK(strchr(s, 'a') == s + 1 && strrchr(s, 'a') == s + 5 && strchr(s, 0) == s + 6 && strchr(s, 'z') == 0 && strrchr(s, 'z') == 0); }
TEST(strstr_finds, "C11 7.24.5.7") { const char *s = "one two three"; CHECK(strstr(s, "two") == s + 4 && strstr(s, "") == s && strstr(s, "four") == 0 && strstr(s, "three") == s + 8 && strstr("aab", "ab")[0] == 'a'); }
TEST(strspn_family, "C11 7.24.5") { CHECK(strspn("123abc", "0123456789") == 3 && strcspn("abc,def", ",;") == 3 && strpbrk("abc;def", ",;")[1] == 'd' && strpbrk("abc", "xyz") == 0); }
TEST(strtok_splits, "C11 7.24.5.8") { char s[] = " a,b;;c "; CHECK(strcmp(strtok(s, " ,;"), "a") == 0 && strcmp(strtok(0, " ,;"), "b") == 0 && strcmp(strtok(0, " ,;"), "c") == 0 && strtok(0, " ,;") == 0); }
TEST(ctype_classes, "C11 7.4.1")
{
    int digits = 0, letters = 0, spaces = 0, graphs = 0, hex = 0, punct = 0;
    for (int c = 0; c < 128; c++) {
        digits += isdigit(c) != 0;
        letters += isalpha(c) != 0;
        spaces += isspace(c) != 0;
        graphs += isgraph(c) != 0;
        hex += isxdigit(c) != 0;
        punct += ispunct(c) != 0;
    }
    CHECK(digits == 10 && letters == 52 && spaces == 6 && graphs == 94 && hex == 22 && punct == 32);
}
TEST(case_mapping, "C11 7.4.2") { CHECK(toupper('a') == 'A' && toupper('Z') == 'Z' && tolower('Q') == 'q' && tolower('5') == '5' && isupper('A') && !isupper('a') && islower('z') && iscntrl(9) && isprint(' ') && isalnum('_') == 0 && isblank('\t')); }
TEST(atoi_and_atol, "C11 7.22.1") { CHECK(atoi("  -123xyz") == -123 && atoi("+7") == 7 && atol("123456789") == 123456789L && atoi("") == 0 && atoll("-123456789012") == -123456789012ll); }
TEST(strtol_bases, "C11 7.22.1.4") { char *end; CHECK(strtol("0x1fz", &end, 0) == 31 && *end == 'z' && strtol("077", 0, 0) == 63 && strtol("zz", 0, 36) == 1295 && strtol("-101", 0, 2) == -5 && strtoul("ffffffff", 0, 16) == 0xFFFFFFFFul); }
TEST(strtol_limits, "C11 7.22.1.4p8") { errno = 0; CHECK(strtol("99999999999", 0, 10) == LONG_MAX && errno == ERANGE && strtol("-99999999999", 0, 10) == LONG_MIN && strtol("-2147483648", 0, 10) == LONG_MIN); }
TEST(strtol_without_number, "C11 7.22.1.4p7") { const char *s = "  x"; char *end; CHECK(strtol(s, &end, 10) == 0 && end == s); }
TEST(absolute_values, "C11 7.22.6.1") { CHECK(abs(I(-5)) == 5 && labs(L(-100000)) == 100000L && llabs(LL(-5000000000ll)) == 5000000000ll); }
TEST(div_functions, "C11 7.22.6.2") { div_t d = div(I(-7), I(2)); ldiv_t l = ldiv(L(1000001), L(-1000)); CHECK(d.quot == -3 && d.rem == -1 && l.quot == -1000 && l.rem == 1); }
static int compare_ints(const void *a, const void *b) { int x = *(const int *)a, y = *(const int *)b; return (x > y) - (x < y); }
TEST(qsort_and_bsearch, "C11 7.22.5")
{
    int v[17];
    unsigned seed = U(1);
    for (int i = 0; i < 17; i++)
        v[i] = (int)(seed = seed * 25173u + 13849u);
    v[3] = 77;
    qsort(v, 17, sizeof *v, compare_ints);
    for (int i = 1; i < 17; i++)
        CHECK(v[i - 1] <= v[i]);
    int key = 77, none = 78;
    int *found = bsearch(&key, v, 17, sizeof *v, compare_ints);
    CHECK(found && *found == 77);
    found = bsearch(&none, v, 17, sizeof *v, compare_ints);
    CHECK(!found || *found == 78);
}
static int compare_strings(const void *a, const void *b) { return strcmp(a, b); }
TEST(qsort_odd_sizes, "C11 7.22.5.2") { char v[5][3] = {"dd", "bb", "ee", "aa", "cc"}; qsort(v, 5, 3, compare_strings); CHECK(strcmp(v[0], "aa") == 0 && strcmp(v[4], "ee") == 0 && strcmp(v[2], "cc") == 0); }
TEST(rand_repeats, "C11 7.22.2") { srand(7); int a = rand(), b = rand(); srand(7); CHECK(rand() == a && rand() == b && a != b && a >= 0); }
static jmp_buf place;
static NOINLINE void jump(int n) { if (n == 0) longjmp(place, 5); jump(n - 1); }
TEST(setjmp_and_longjmp, "C11 7.13.2.1") { volatile int trace = 1; int r = setjmp(place); if (r == 0) { trace = 2; jump(I(3)); trace = 3; } CHECK(r == 5 && trace == 2); }
TEST(longjmp_of_zero_gives_one, "C11 7.13.2.1p4") { int r = setjmp(place); if (r == 0) longjmp(place, I(0)); CHECK(r == 1); }
