/* SPDX-License-Identifier: MIT */
/* Multibyte characters of the "C" locale (C11 7.22.7, 7.22.8): each is one byte, whose value is that of its wide character. */
#include <stdlib.h>

int mblen(const char *text, size_t limit)
{
    return mbtowc(NULL, text, limit);
}

int mbtowc(wchar_t *restrict to, const char *restrict text, size_t limit)
{
    if (!text)
        return 0;
    if (!limit)
        return -1;
    if (to)
        *to = (unsigned char)*text;
    return *text != 0;
}

int wctomb(char *to, wchar_t character)
{
    if (!to)
        return 0;
    if (character > 0xFF)
        return -1;
    *to = (char)character;
    return 1;
}

size_t mbstowcs(wchar_t *restrict to, const char *restrict text, size_t limit)
{
    size_t count = 0;
    for (; (!to || count < limit) && text[count]; count++)
        if (to)
            to[count] = (unsigned char)text[count];
    if (to && count < limit)
        to[count] = 0;
    return count;
}

size_t wcstombs(char *restrict to, const wchar_t *restrict text, size_t limit)
{
    size_t count = 0;
    for (; (!to || count < limit) && text[count]; count++) {
        if (text[count] > 0xFF)
            return (size_t)-1;
        if (to)
            to[count] = (char)text[count];
    }
    if (to && count < limit)
        to[count] = 0;
    return count;
}
