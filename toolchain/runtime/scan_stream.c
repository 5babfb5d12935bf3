/* SPDX-License-Identifier: MIT */
/* scanf, fscanf, vscanf, vfscanf: the conversions of sscanf on a stream with one character of push-back. */
#include "scan_parts.h"

#include <stdarg.h>
#include <stdio.h>

#define MOST 64 /* maximum number of characters of a number */

typedef struct {
    unsigned count; /* characters read */
    unsigned width; /* characters left in the field */
} input_t;

/* Return the next character without consuming it; EOF at the end of the input or of the field. */
static int peek(const input_t *in)
{
    if (!in->width)
        return EOF;
    int character = getchar();
    if (character != EOF)
        ungetc(character, stdin);
    return character;
}

static void take(input_t *in)
{
    getchar();
    in->count++;
    in->width--;
}

static void skip_space(input_t *in)
{
    in->width = UINT16_MAX;
    while (isspace(peek(in)))
        take(in);
}

/* Consume the next character if `characters` contains it; return whether it does. */
static int accept(input_t *in, char *field, unsigned *length, const char *characters)
{
    int next = peek(in);
    if (next <= 0 || !strchr(characters, next) || *length == MOST)
        return 0;
    take(in);
    field[(*length)++] = (char)next;
    return 1;
}

static void accept_all(input_t *in, char *field, unsigned *length, const char *characters)
{
    while (accept(in, field, length, characters)) {
    }
}

/* Read the longest text that is a prefix of an integer (C11 7.21.6.2p9). */
static unsigned integer_field(input_t *in, char *field, char conversion)
{
    static const char digits[] = "0123456789abcdefABCDEF";
    unsigned length = 0;
    accept(in, field, &length, "+-");
    int base = conversion == 'o' ? 8 : conversion == 'd' || conversion == 'u' ? 10 : 16;
    if (base == 16 && accept(in, field, &length, "0")) {
        if (!accept(in, field, &length, "xX") && conversion == 'i')
            base = 8;
    } else if (conversion == 'i') {
        base = 10;
    }
    char allowed[sizeof digits];
    strcpy(allowed, digits);
    if (base < 16)
        allowed[base] = 0;
    accept_all(in, field, &length, allowed);
    return length;
}

/* Read the longest text that is a prefix of a floating-point number. */
static unsigned floating_field(input_t *in, char *field)
{
    static const char *const words[] = {"infinity", "nan"};
    const char *digits = "0123456789", *power = "eE";
    unsigned length = 0;
    accept(in, field, &length, "+-");
    for (int k = 0; k < 2; k++) {
        const char *at = words[k];
        for (; *at; at++) {
            char either[] = {*at, (char)(*at & ~0x20), 0};
            if (!accept(in, field, &length, either))
                break;
        }
        if (at == words[k])
            continue;
        if (!*at && k && accept(in, field, &length, "(")) {
            accept_all(in, field, &length, "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ_abcdefghijklmnopqrstuvwxyz");
            accept(in, field, &length, ")");
        }
        return length;
    }
    if (accept(in, field, &length, "0") && accept(in, field, &length, "xX")) {
        digits = "0123456789abcdefABCDEF";
        power = "pP";
    }
    accept_all(in, field, &length, digits);
    if (accept(in, field, &length, "."))
        accept_all(in, field, &length, digits);
    if (accept(in, field, &length, power)) {
        accept(in, field, &length, "+-");
        accept_all(in, field, &length, "0123456789");
    }
    return length;
}

/* Read a field for %c %s %[ into `to`, if that is not NULL; return whether the field matched. */
static int text_field(input_t *in, char conversion, const char *set, char *to)
{
    unsigned wanted = in->width;
    const char *ignored;
    int next, any = 0;
    while ((next = peek(in)) != EOF) {
        if (conversion == 's' ? isspace(next) : conversion == '[' && !in_set(set, (char)next, &ignored))
            break;
        take(in);
        any = 1;
        if (to)
            *to++ = (char)next;
    }
    if (conversion == 'c')
        return wanted && !in->width;
    if (any && to)
        *to = 0;
    return any;
}

int vscanf(const char *restrict format, va_list arguments)
{
    input_t in = {0, 0};
    int stored = 0;
    for (; *format; format++) {
        in.width = UINT16_MAX;
        if (isspace((unsigned char)*format)) {
            skip_space(&in);
            continue;
        }
        if (*format != '%' || format[1] == '%') {
            if (*format == '%') {
                format++;
                skip_space(&in);
            }
            int next = peek(&in);
            if (next != (unsigned char)*format)
                return next != EOF || stored ? stored : EOF;
            take(&in);
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
        void *to = suppressed ? NULL : va_arg(arguments, void *);
        if (conversion == 'n') {
            store_count(to, length, in.count);
            continue;
        }
        if (conversion != 'c' && conversion != '[')
            skip_space(&in);
        if (peek(&in) == EOF)
            return stored ? stored : EOF;
        in.width = width ? width : conversion == 'c' ? 1 : UINT16_MAX;
        const char *set = format + 1, *after;
        if (conversion == '[') {
            (void)in_set(set, 0, &after);
            format = after - 1;
        }
        int matched;
        if (strchr("cs[", conversion)) {
            matched = text_field(&in, conversion, set, to);
        } else {
            char field[MOST + 1];
            unsigned count =
                strchr("aefgAEFG", conversion) ? floating_field(&in, field) : integer_field(&in, field, conversion);
            field[count] = 0;
            matched = count && number_field(field, count, conversion, length, to) == field + count;
        }
        if (!matched)
            return stored;
        stored += to != NULL;
    }
    return stored;
}

int scanf(const char *restrict format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    int stored = vscanf(format, arguments);
    va_end(arguments);
    return stored;
}

int vfscanf(FILE *restrict stream, const char *restrict format, va_list arguments)
{
    (void)stream;
    return vscanf(format, arguments);
}

int fscanf(FILE *restrict stream, const char *restrict format, ...)
{
    (void)stream;
    va_list arguments;
    va_start(arguments, format);
    int stored = vscanf(format, arguments);
    va_end(arguments);
    return stored;
}
