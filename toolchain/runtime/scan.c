/* SPDX-License-Identifier: MIT */
/* sscanf, vsscanf (C11 7.21.6.2): d i u o x X p c s [ n %, with *, width and hh h l ll j z t L; floating conversions too. */
#include "scan.h"
#include "scan_integer.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

static SCAN_INTEGER(scan_long, unsigned long)

/* Size of what a conversion stores into, in units that name themselves. */
enum { INT, CHAR, SHORT, LONG, WIDE };

static const char *read_length(const char *format, int *length)
{
    *length = INT;
    switch (*format) {
    case 'h':
        *length = format[1] == 'h' ? CHAR : SHORT;
        return format + (*length == CHAR ? 2 : 1);
    case 'l':
        *length = format[1] == 'l' ? WIDE : LONG;
        return format + (*length == WIDE ? 2 : 1);
    case 'j':
        *length = WIDE;
        return format + 1;
    case 'L':
        *length = LONG;
        return format + 1;
    case 'z':
    case 't':
        return format + 1;
    default:
        return format;
    }
}

static void store(void *to, int length, unsigned long value)
{
    if (length == CHAR)
        *(unsigned char *)to = (unsigned char)value;
    else if (length == LONG)
        *(uint32_t *)to = (uint32_t)value;
    else
        *(unsigned short *)to = (unsigned short)value;
}

/* Whether the set behind `%[` holds the character; *end becomes the place behind its `]`. */
static int in_set(const char *set, char character, const char **end)
{
    int inverted = *set == '^', found = 0;
    set += inverted;
    const char *first = set;
    for (; *set && (*set != ']' || set == first); set++) {
        if (set[1] == '-' && set[2] && set[2] != ']') {
            found |= (unsigned char)*set <= (unsigned char)character && (unsigned char)character <= (unsigned char)set[2];
            set += 2;
        } else {
            found |= *set == character;
        }
    }
    *end = *set ? set + 1 : set;
    return character && found != inverted;
}

/* %c %s %[: the end of the field from `at`, which is at most `width` long; NULL when the field is empty or too short. */
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

static const char *number_field(const char *at, unsigned width, char conversion, int length, void *to)
{
    const char *stop = at + strnlen(at, width), *after;
    int base = conversion == 'd' || conversion == 'u' ? 10 : conversion == 'o' ? 8 : conversion == 'i' ? 0 : 16;
    if (strchr("aefgAEFG", conversion)) {
        double value;
        after = __scan_double ? __scan_double(at, stop, &value) : NULL;
        if (after && to && length == LONG)
            *(double *)to = value;
        else if (after && to)
            *(float *)to = (float)value;
        return after;
    }
    if (length == WIDE) {
        unsigned long long value;
        after = __scan_wide ? __scan_wide(at, stop, base, &value) : NULL;
        if (after && to)
            *(unsigned long long *)to = value;
        return after;
    }
    unsigned long value;
    after = scan_long(at, stop, base, &value);
    if (after && to)
        store(to, length, value);
    return after;
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
            if (to)
                store(to, length, (unsigned long)(at - text));
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
