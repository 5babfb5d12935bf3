/* SPDX-License-Identifier: MIT */
/* Integers at the start of a text (C11 7.22.1.4): TEXT_INTEGER(TYPE, MOST) defines magnitude() for an unsigned type.
 * MOST is the largest `value` to which `digit` can be appended in `base` without overflow. */
#ifndef TEXT_INTEGER_H
#define TEXT_INTEGER_H

#include <ctype.h>

/* Return the value of a digit in any base up to 36, or 99. */
static unsigned digit_value(char character)
{
    if (isdigit(character))
        return (unsigned)(character - '0');
    return isalpha(character) ? (unsigned)(tolower(character) - 'a' + 10) : 99;
}

/* Return the magnitude of the number at `text`; *negative becomes its sign, *overflow whether it does not fit. */
#define TEXT_INTEGER(TYPE, MOST)                                                                                  \
    static TYPE magnitude(const char *text, char **end, int base, int *negative, int *overflow)                   \
    {                                                                                                             \
        const char *at = text;                                                                                    \
        TYPE value = 0;                                                                                           \
        int digits = 0;                                                                                           \
        while (isspace(*at))                                                                                      \
            at++;                                                                                                 \
        *negative = *at == '-';                                                                                   \
        if (*at == '-' || *at == '+')                                                                             \
            at++;                                                                                                 \
        if ((base == 0 || base == 16) && at[0] == '0' && (at[1] | 0x20) == 'x' && digit_value(at[2]) < 16) {      \
            at += 2;                                                                                              \
            base = 16;                                                                                            \
        }                                                                                                         \
        if (base == 0)                                                                                            \
            base = *at == '0' ? 8 : 10;                                                                           \
        *overflow = 0;                                                                                            \
        for (unsigned digit; (digit = digit_value(*at)) < (unsigned)base; at++, digits = 1) {                     \
            if (value > (MOST))                                                                                   \
                *overflow = 1;                                                                                    \
            value = value * (unsigned)base + digit;                                                               \
        }                                                                                                         \
        if (end)                                                                                                  \
            *end = (char *)(digits ? at : text);                                                                  \
        return value;                                                                                             \
    }

#endif
