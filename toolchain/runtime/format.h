/* SPDX-License-Identifier: MIT */
/* Internal declarations of the printf family. */
#ifndef FORMAT_H
#define FORMAT_H

#include <stdarg.h>
#include <stddef.h>

/* Destination of characters. `put` stores one; `count` is the return value of printf. */
typedef struct sink {
    void (*put)(struct sink *sink, char character);
    char *at, *end;
    int count;
} sink_t;

/* One conversion specification (C11 7.21.6.1p4). */
enum { LEFT = 1, PLUS = 2, SPACE = 4, ALTERNATE = 8, ZERO = 16, LONG = 32, WIDE = 64, BYTE = 128 };
typedef struct {
    unsigned char flags;
    char conversion;
    int width;
    int precision; /* -1: none given */
} spec_t;

/* Write the formatted text to `sink`; return the count. format.s depends on the layout of both structures. */
int __format(sink_t *sink, const char *format, va_list arguments);

/* Write prefix, zeros and digits, padded to the field width. `digits` are in reverse order; `prefix` contains up to two
 * characters, the first one in the low byte, 0 for none. */
void __format_field(sink_t *sink, const spec_t *spec, unsigned prefix, const char *digits, int count);

void __format_pad(sink_t *sink, char character, int count);

/* Conversions of 64-bit integers and doubles. The driver links them if a format string of the program contains
 * them; otherwise their addresses are null. */
void __format_wide(sink_t *sink, const spec_t *spec, unsigned long long value, int negative);
void __format_double(sink_t *sink, const spec_t *spec, double value);

#endif
