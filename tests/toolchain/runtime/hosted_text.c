/* Prints results of text functions for inputs that are equal on the emulator and on the host. */
#include <errno.h>
#include <inttypes.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint32_t state = 7216;
static unsigned below(unsigned n) /* a pseudo-random number below n, from a linear congruential generator */
{
    state = state * 1664525u + 1013904223u;
    return (unsigned)(state >> 16) % n;
}

static void digits(char *to, const char *letters)
{
    static const char *const starts[] = {"", "", " ", "\t\n ", "-", "+", " -", "- ", "0x", "-0X", "0", "00"};
    unsigned count = strlen(letters);
    strcpy(to, starts[below(12)]);
    to += strlen(to);
    for (unsigned left = below(below(4) ? 12 : 24); left; left--)
        *to++ = letters[below(count)];
    strcpy(to, below(3) ? "" : "z.");
}

static void integers(void)
{
    static const int bases[] = {0, 10, 16, 8, 2, 36, 7};
    static const char *const letters[] = {"0123456789", "0123456789abcdefABCDEF", "01234567", "01", "09azAZ"};
    char text[48], *end;
    for (int i = 0; i < 120; i++) {
        digits(text, letters[below(5)]);
        int base = bases[below(7)];
        errno = 0;
        long long value = i & 1 ? strtoll(text, &end, base) : strtoimax(text, &end, base);
        printf("%s: %lld %d %d,", text, value, (int)(end - text), errno == ERANGE);
        errno = 0;
        unsigned long long same = i & 1 ? strtoull(text, &end, base) : strtoumax(text, &end, base);
        printf(" %llu %d %d", same, (int)(end - text), errno == ERANGE);
        value = value == INTMAX_MIN ? 1 : value;
        imaxdiv_t parts = imaxdiv(value, 1 + (int)below(3000));
        printf(" %lld %lld %lld\n", (long long)imaxabs(value), (long long)parts.quot, (long long)parts.rem);
    }
}

static void floats(void)
{
    static const char *const odd[] = {"inf",  "-Infinity", "nan",     "nan(1)x",    "nan(-)",        "0x",   "0x1.8p3", "1e",
                                      "1e+9", "3.4e38",    "3.5e38x", "1e-45",      "7.1e-46",       "7e-46", ".",       "-.5",
                                      "0x1p-149", "0x1p-150", "0x1.8p-150", "16777217", "16777219", "16777217.0000001"};
    char text[64], *end;
    for (int i = 0; i < 100; i++) {
        if (i < 22) {
            strcpy(text, odd[i]);
        } else {
            digits(text, "0123456789");
            char *at = text + strcspn(text, "z");
            if (below(2))
                at += sprintf(at, ".%u", below(10000));
            if (below(2))
                sprintf(at, "e%d", (int)below(100) - 50);
        }
        float value = strtof(text, &end);
        uint32_t bits;
        memcpy(&bits, &value, sizeof bits);
        if (value != value)
            bits = 0x7fc00000; /* of either sign */
        printf("%s: %08lx %d\n", text, (unsigned long)bits, (int)(end - text));
    }
    long double same = strtold("0.1x", &end);
    printf("%d\n", (int)((double)same == 0.1) + (*end == 'x'));
}

static void strings(void)
{
    char to[8];
    wchar_t wide[8];
    for (unsigned limit = 0; limit < 8; limit++) {
        unsigned length = (unsigned)strxfrm(to, "abcd", limit);
        printf("%u %s", length, length < limit ? to : "");
        memset(wide, 0, sizeof wide);
        length = (unsigned)mbstowcs(wide, "wxyz", limit);
        printf(" %u %u", length, (unsigned)wide[3]);
        memset(to, '.', sizeof to);
        length = (unsigned)wcstombs(to, L"klmno", limit);
        printf(" %u %.8s\n", length, to);
    }
    wchar_t one = 5;
    printf("%d %d %d", mblen("", 1), mblen("a", 1), mbtowc(&one, "b", 3));
    printf(" %d %d", (int)one, wctomb(NULL, L'a'));
    printf(" %d", wctomb(to, L'c'));
    printf(" %c\n", to[0]);
    printf("%d %d %d\n", strcoll("a", "b") < 0, strcoll("b", "a") > 0, strcoll("a", "a"));
}

int main(void)
{
    integers();
    floats();
    strings();
    return 0;
}
