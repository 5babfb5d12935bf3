/* SPDX-License-Identifier: MIT */
/* Integers in a text of limited width (C11 7.21.6.2p10): SCAN_INTEGER(NAME, TYPE) defines a function that reads into TYPE.
 * Unlike in strtol, 0x without a digit is not 0 but the prefix of an incomplete number. */
#ifndef SCAN_INTEGER_H
#define SCAN_INTEGER_H

#include <ctype.h>
#include <stddef.h>

static unsigned digit_of(char character)
{
    if (isdigit((unsigned char)character))
        return (unsigned)(character - '0');
    return isalpha((unsigned char)character) ? (unsigned)(tolower((unsigned char)character) - 'a' + 10) : 99;
}

#define SCAN_INTEGER(NAME, TYPE)                                                                                  \
    const char *NAME(const char *at, const char *stop, int base, TYPE *value)                                     \
    {                                                                                                             \
        TYPE sum = 0;                                                                                             \
        int any = 0, negative = at < stop && *at == '-';                                                          \
        if (at < stop && (*at == '-' || *at == '+'))                                                              \
            at++;                                                                                                 \
        if ((base == 0 || base == 16) && stop - at > 1 && at[0] == '0' && (at[1] | 0x20) == 'x') {                \
            at += 2;                                                                                              \
            base = 16;                                                                                            \
        }                                                                                                         \
        if (base == 0)                                                                                            \
            base = at < stop && *at == '0' ? 8 : 10;                                                              \
        for (unsigned digit; at < stop && (digit = digit_of(*at)) < (unsigned)base; at++, any = 1)                \
            sum = sum * (unsigned)base + digit;                                                                   \
        *value = negative ? 0 - sum : sum;                                                                        \
        return any ? at : NULL;                                                                                   \
    }

#endif
