/* SPDX-License-Identifier: MIT */
/* Output of fields for the conversions of printf that are in C; format.s has its own, which needs less stack. */
#include "format.h"

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
