/* SPDX-License-Identifier: MIT */
/* Conversions of text to 64-bit integers (C11 7.22.1.4, 7.8.2.3), and the other functions of inttypes.h. */
#include "text_integer.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <stdlib.h>

/* Another digit can overflow only if the highest six bits are not all 0, so the division is rarely needed. */
TEXT_INTEGER(unsigned long long, value >> 58 ? (ULLONG_MAX - digit) / (unsigned)base : value)

unsigned long long strtoull(const char *restrict text, char **restrict end, int base)
{
    int negative, overflow;
    unsigned long long value = magnitude(text, end, base, &negative, &overflow);
    if (overflow) {
        errno = ERANGE;
        return ULLONG_MAX;
    }
    return negative ? 0 - value : value;
}

long long strtoll(const char *restrict text, char **restrict end, int base)
{
    int negative, overflow;
    unsigned long long value = magnitude(text, end, base, &negative, &overflow);
    if (overflow || value > (unsigned long long)LLONG_MAX + (unsigned)negative) {
        errno = ERANGE;
        return negative ? LLONG_MIN : LLONG_MAX;
    }
    return negative ? (long long)(0 - value) : (long long)value;
}

uintmax_t strtoumax(const char *restrict text, char **restrict end, int base)
{
    return strtoull(text, end, base);
}

intmax_t strtoimax(const char *restrict text, char **restrict end, int base)
{
    return strtoll(text, end, base);
}

intmax_t imaxabs(intmax_t value)
{
    return value < 0 ? -value : value;
}

imaxdiv_t imaxdiv(intmax_t numerator, intmax_t denominator)
{
    imaxdiv_t result = {numerator / denominator, numerator % denominator};
    return result;
}
