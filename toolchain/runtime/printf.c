/* SPDX-License-Identifier: MIT */
/* printf, vprintf, puts, putchar; all output is written by __putchar (stdio.h). */
#include "format.h"

#include <bounds.h>
#include <stdio.h>

TARGETS_OF(format_put, send);
TARGETS_OF(__format_pad, send);
TARGETS_OF(__format_field, send);
TARGETS_OF(__format_double, send);

static void send(sink_t *sink, char character)
{
    __putchar(character);
    sink->count++;
}

int vprintf(const char *restrict format, va_list arguments)
{
    sink_t sink = {send, NULL, NULL, 0};
    return __format(&sink, format, arguments);
}

int printf(const char *restrict format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    int count = vprintf(format, arguments);
    va_end(arguments);
    return count;
}

int putchar(int character)
{
    __putchar((unsigned char)character);
    return (unsigned char)character;
}

int puts(const char *text)
{
    for (; *text; text++)
        __putchar(*text);
    __putchar('\n');
    return 0;
}
