/* The heart of the printf family (C11 7.21.6.1). 64-bit and floating conversions live in files of their own, so that
 * programs that never use them pay neither flash nor stack for them. */
#include "format.h"

#include <string.h>

#pragma weak __format_wide
#pragma weak __format_double

void __format_pad(sink_t *sink, char character, int count)
{
    for (; count > 0; count--)
        sink->put(sink, character);
}

void __format_field(sink_t *sink, const spec_t *spec, unsigned prefix, const char *digits, int count)
{
    int zeros = spec->precision - count;
    int width = spec->width - count;
    for (unsigned rest = prefix; rest; rest >>= 8)
        width--;
    if (zeros < 0)
        zeros = 0;
    if ((spec->flags & (ZERO | LEFT)) == ZERO && spec->precision < 0) {
        zeros = width > 0 ? width : 0;
    }
    width -= zeros;
    if (!(spec->flags & LEFT))
        __format_pad(sink, ' ', width);
    for (; prefix; prefix >>= 8)
        sink->put(sink, (char)prefix);
    __format_pad(sink, '0', zeros);
    while (count > 0)
        sink->put(sink, digits[--count]);
    if (spec->flags & LEFT)
        __format_pad(sink, ' ', width);
}

static void format_integer(sink_t *sink, const spec_t *spec, unsigned long value, int negative)
{
    char digits[11]; /* 32 bits in octal */
    int count = 0;
    unsigned prefix = negative ? '-' : spec->flags & PLUS ? '+' : spec->flags & SPACE ? ' ' : 0;
    unsigned base = 10;
    char letters = 'a' - 10;
    if (spec->conversion == 'o') {
        base = 8;
    } else if ((spec->conversion | 0x20) == 'x') {
        base = 16;
        letters = (char)(spec->conversion - 'x' + 'a' - 10);
        if (spec->flags & ALTERNATE && value)
            prefix = '0' | (unsigned)spec->conversion << 8;
    }
    if (value == 0 && spec->precision != 0)
        digits[count++] = '0';
    for (; value; value /= base) {
        char digit = (char)(value % base);
        digits[count++] = (char)(digit + (digit < 10 ? '0' : letters));
    }
    if (spec->conversion == 'o' && spec->flags & ALTERNATE && (count == 0 || digits[count - 1] != '0'))
        digits[count++] = '0';
    __format_field(sink, spec, prefix, digits, count);
}

static void format_string(sink_t *sink, const spec_t *spec, const char *text)
{
    int length = 0;
    while (length != spec->precision && text[length])
        length++;
    if (!(spec->flags & LEFT))
        __format_pad(sink, ' ', spec->width - length);
    for (int i = 0; i < length; i++)
        sink->put(sink, text[i]);
    if (spec->flags & LEFT)
        __format_pad(sink, ' ', spec->width - length);
}

static unsigned char flag_of(char character)
{
    switch (character) {
    case '-':
        return LEFT;
    case '+':
        return PLUS;
    case ' ':
        return SPACE;
    case '#':
        return ALTERNATE;
    case '0':
        return ZERO;
    default:
        return 0;
    }
}

static const char *read_number(const char *format, int *number)
{
    for (*number = 0; *format >= '0' && *format <= '9'; format++)
        *number = *number * 10 + (*format - '0');
    return format;
}

static const char *read_length(const char *format, spec_t *spec)
{
    for (;; format++) {
        if (*format == 'l')
            spec->flags |= spec->flags & LONG ? WIDE : LONG;
        else if (*format == 'j')
            spec->flags |= WIDE;
        else if (*format == 'h')
            spec->flags = (unsigned char)(format[1] == 'h' ? spec->flags | BYTE : spec->flags);
        else if (*format != 'z' && *format != 't' && *format != 'L')
            return format;
    }
}

int __format(sink_t *sink, const char *format, va_list arguments)
{
    for (; *format; format++) {
        if (*format != '%') {
            sink->put(sink, *format);
            continue;
        }
        spec_t spec = {0, 0, 0, -1};
        unsigned char flag;
        while ((flag = flag_of(*++format)) != 0)
            spec.flags |= flag;
        if (*format == '*') {
            format++;
            spec.width = va_arg(arguments, int);
            if (spec.width < 0) {
                spec.width = -spec.width;
                spec.flags |= LEFT;
            }
        } else {
            format = read_number(format, &spec.width);
        }
        if (*format == '.') {
            if (*++format == '*') {
                format++;
                spec.precision = va_arg(arguments, int);
            } else {
                format = read_number(format, &spec.precision);
            }
        }
        format = read_length(format, &spec);
        spec.conversion = *format;
        switch (*format) {
        case 'd':
        case 'i': {
            if (spec.flags & WIDE) {
                long long value = va_arg(arguments, long long);
                if (__format_wide)
                    __format_wide(sink, &spec, value < 0 ? 0 - (unsigned long long)value : (unsigned long long)value,
                                  value < 0);
                break;
            }
            long value = spec.flags & LONG ? va_arg(arguments, long) : va_arg(arguments, int);
            if (spec.flags & BYTE)
                value = (signed char)value;
            format_integer(sink, &spec, value < 0 ? 0 - (unsigned long)value : (unsigned long)value, value < 0);
            break;
        }
        case 'p':
            spec.flags |= ALTERNATE;
            spec.conversion = 'x';
            format_integer(sink, &spec, va_arg(arguments, unsigned), 0);
            break;
        case 'u':
        case 'x':
        case 'X':
        case 'o': {
            spec.flags &= (unsigned char)~(PLUS | SPACE);
            if (spec.flags & WIDE) {
                unsigned long long value = va_arg(arguments, unsigned long long);
                if (__format_wide)
                    __format_wide(sink, &spec, value, 0);
                break;
            }
            unsigned long value = spec.flags & LONG ? va_arg(arguments, unsigned long) : va_arg(arguments, unsigned);
            format_integer(sink, &spec, spec.flags & BYTE ? (unsigned char)value : value, 0);
            break;
        }
        case 'c': {
            char character = (char)va_arg(arguments, int);
            if (!(spec.flags & LEFT))
                __format_pad(sink, ' ', spec.width - 1);
            sink->put(sink, character);
            if (spec.flags & LEFT)
                __format_pad(sink, ' ', spec.width - 1);
            break;
        }
        case 's':
            format_string(sink, &spec, va_arg(arguments, const char *));
            break;
        case 'f':
        case 'F':
        case 'e':
        case 'E':
        case 'g':
        case 'G': {
            double value = va_arg(arguments, double);
            if (__format_double)
                __format_double(sink, &spec, value);
            break;
        }
        case 0:
            return sink->count;
        default:
            sink->put(sink, *format);
        }
    }
    return sink->count;
}
