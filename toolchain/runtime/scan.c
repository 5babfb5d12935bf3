/* SPDX-License-Identifier: MIT */
/* sscanf, vsscanf (C11 7.21.6.2): d i u o x X p c s [ n %, with *, width and hh h l ll j z t L; floating conversions too. */
#include "scan_parts.h"

#include <stdarg.h>
#include <stdio.h>

/* Return the end of the field at `at` for %c %s %[, at most `width` long; NULL if the field is empty or too short. */
static const char *text_field(const char *at, char conversion, const char *set, unsigned width)
{
    const char *from = at, *ignored;
    if (conversion == 'c') {
        unsigned length = (unsigned)strnlen(at, width);
        return length < width ? NULL : at + width;
    }
    while (*at && (unsigned)(at - from) < width &&
           (conversion == 's' ? !isspace((unsigned char)*at) : in_set(set, *at, &ignored)))
        at++;
    return at == from ? NULL : at;
}

int vsscanf(const char *restrict text, const char *restrict format, va_list arguments)
{
    const char *at = text;
    int stored = 0;
    for (; *format; format++) {
        if (isspace((unsigned char)*format)) {
            while (isspace((unsigned char)*at))
                at++;
            continue;
        }
        if (*format != '%') {
            if (*at != *format)
                return *at || stored ? stored : EOF;
            at++;
            continue;
        }
        format++;
        int suppressed = *format == '*', length;
        format += suppressed;
        unsigned width = 0;
        for (; isdigit((unsigned char)*format); format++)
            width = width * 10 + (unsigned)(*format - '0');
        format = read_length(format, &length);
        char conversion = *format;
        if (!conversion)
            return stored;
        void *to = suppressed || conversion == '%' ? NULL : va_arg(arguments, void *);
        if (conversion == 'n') {
            store_count(to, length, (unsigned)(at - text));
            continue;
        }
        if (conversion != 'c' && conversion != '[')
            while (isspace((unsigned char)*at))
                at++;
        if (!*at)
            return stored ? stored : EOF;
        if (!width)
            width = conversion == 'c' ? 1 : UINT16_MAX / 2;
        if (conversion == '%') {
            if (*at++ != '%')
                return stored;
            continue;
        }
        const char *set = format + 1, *after;
        if (conversion == '[') {
            (void)in_set(set, 0, &after);
            format = after - 1;
        }
        if (strchr("cs[", conversion)) {
            after = text_field(at, conversion, set, width);
            if (after && to) {
                memcpy(to, at, (unsigned)(after - at));
                if (conversion != 'c')
                    ((char *)to)[after - at] = 0;
            }
        } else {
            after = number_field(at, width, conversion, length, to);
        }
        if (!after)
            return stored;
        at = after;
        stored += to != NULL;
    }
    return stored;
}

int sscanf(const char *restrict text, const char *restrict format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    int stored = vsscanf(text, format, arguments);
    va_end(arguments);
    return stored;
}
