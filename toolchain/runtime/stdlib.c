/* SPDX-License-Identifier: MIT */
/* Integer conversions, arithmetic, random numbers (C11 7.22). */
#include "text_integer.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>

int errno;

int abs(int value)
{
    return value < 0 ? -value : value;
}

long labs(long value)
{
    return value < 0 ? -value : value;
}

long long llabs(long long value)
{
    return value < 0 ? -value : value;
}

div_t div(int numerator, int denominator)
{
    div_t result = {numerator / denominator, numerator % denominator};
    return result;
}

ldiv_t ldiv(long numerator, long denominator)
{
    ldiv_t result = {numerator / denominator, numerator % denominator};
    return result;
}

lldiv_t lldiv(long long numerator, long long denominator)
{
    lldiv_t result = {numerator / denominator, numerator % denominator};
    return result;
}

TEXT_INTEGER(unsigned long, (ULONG_MAX - digit) / (unsigned)base)

unsigned long strtoul(const char *restrict text, char **restrict end, int base)
{
    int negative, overflow;
    unsigned long value = magnitude(text, end, base, &negative, &overflow);
    if (overflow) {
        errno = ERANGE;
        return ULONG_MAX;
    }
    return negative ? 0 - value : value;
}

long strtol(const char *restrict text, char **restrict end, int base)
{
    int negative, overflow;
    unsigned long value = magnitude(text, end, base, &negative, &overflow);
    if (overflow || value > (unsigned long)LONG_MAX + (unsigned long)negative) {
        errno = ERANGE;
        return negative ? LONG_MIN : LONG_MAX;
    }
    return negative ? (long)(0 - value) : (long)value;
}

int atoi(const char *text)
{
    return (int)strtol(text, NULL, 10);
}

long atol(const char *text)
{
    return strtol(text, NULL, 10);
}

long long atoll(const char *text)
{
    unsigned long long value = 0;
    while (isspace(*text))
        text++;
    int negative = *text == '-';
    if (*text == '-' || *text == '+')
        text++;
    for (; isdigit(*text); text++)
        value = value * 10 + (unsigned)(*text - '0');
    return (long long)(negative ? 0 - value : value);
}

/* The random number generator in the example of C11 7.22.2.2. */
static unsigned long random_state = 1;

int rand(void)
{
    random_state = random_state * 1103515245UL + 12345;
    return (int)(random_state >> 16) & RAND_MAX;
}

void srand(unsigned int seed)
{
    random_state = seed;
}
