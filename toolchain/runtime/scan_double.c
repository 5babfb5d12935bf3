/* SPDX-License-Identifier: MIT */
/* Conversions %f, %e, %g, %a of scanf. */
#include "scan.h"
#include "stack_room.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

static const char decimal[] = "0123456789";

/* Return the length of the longest text that is a prefix of a number (C11 7.21.6.2p9). */
static unsigned longest(const char *text)
{
    static const char *const words[] = {"infinity", "nan"};
    const char *at = text;
    at += *at == '+' || *at == '-';
    for (int k = 0; k < 2; k++) {
        unsigned same = 0;
        while (words[k][same] && (at[same] | 0x20) == words[k][same])
            same++;
        if (!same)
            continue;
        at += same;
        if (!words[k][same] && k && *at == '(') {
            do
                at++;
            while (isalnum((unsigned char)*at) || *at == '_');
            at += *at == ')';
        }
        return (unsigned)(at - text);
    }
    const char *digits = decimal;
    char power = 'e';
    if (*at == '0' && (at[1] | 0x20) == 'x') {
        digits = "0123456789abcdefABCDEF";
        power = 'p';
        at += 2;
    }
    at += strspn(at, digits);
    if (*at == '.')
        at += 1 + strspn(at + 1, digits);
    if ((*at | 0x20) == power) {
        at++;
        at += *at == '+' || *at == '-';
        at += strspn(at, decimal);
    }
    return (unsigned)(at - text);
}

const char *__scan_double(const char *at, const char *stop, double *value)
{
    unsigned length = (unsigned)(stop - at);
    STACK_ROOM(length + 1);
    char text[length + 1]; /* a copy, because strtod has no parameter for the width */
    memcpy(text, at, length);
    text[length] = 0;
    char *end;
    *value = strtod(text, &end);
    length = longest(text);
    return end == text || end != text + length ? NULL : at + length; /* a prefix such as "1e" is no number */
}
