/* SPDX-License-Identifier: MIT */
/* Common parts of sscanf and scanf: lengths, sets, numbers. */
#ifndef SCAN_PARTS_H
#define SCAN_PARTS_H

#include "scan.h"
#include "scan_integer.h"

#include <stdint.h>
#include <string.h>

static SCAN_INTEGER(scan_long, unsigned long)

/* Return the size of the object into which a conversion stores. */
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

/* %n: the number of characters read. */
static void store_count(void *to, int length, unsigned count)
{
    if (!to)
        return;
    if (length == WIDE)
        memset(to, 0, sizeof(unsigned long long));
    store(to, length, count);
}

/* Return whether the set after `%[` contains the character; *end becomes the position after its `]`. */
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

/* Whether the program's double has 32 bits (-fshort-double); the library's has 64. */
#ifndef SHORT_DOUBLE
#define SHORT_DOUBLE 0
#endif

static const char *number_field(const char *at, unsigned width, char conversion, int length, void *to)
{
    const char *stop = at + strnlen(at, width), *after;
    int base = conversion == 'd' || conversion == 'u' ? 10 : conversion == 'o' ? 8 : conversion == 'i' ? 0 : 16;
    if (strchr("aefgAEFG", conversion)) {
        double value;
        after = __scan_double ? __scan_double(at, stop, &value) : NULL;
        if (after && to && length == LONG && !SHORT_DOUBLE)
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

#endif
