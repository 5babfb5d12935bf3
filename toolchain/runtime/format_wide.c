/* SPDX-License-Identifier: MIT */
/* Conversions of printf with length ll: 64-bit integers in bases 8, 10 and 16. */
#include "format.h"

void __format_wide(sink_t *sink, const spec_t *spec, unsigned long long value, int negative)
{
    char digits[23]; /* 22 octal digits and a leading 0 */
    int count = 0;
    unsigned prefix = negative ? '-' : spec->flags & PLUS ? '+' : spec->flags & SPACE ? ' ' : 0;
    unsigned base = spec->conversion == 'o' ? 8 : (spec->conversion | 0x20) == 'x' ? 16 : 10;
    char letters = (char)((spec->conversion == 'X' ? 'A' : 'a') - 10);
    if (base == 16 && spec->flags & ALTERNATE && value)
        prefix = '0' | (unsigned)spec->conversion << 8;
    if (value == 0 && spec->precision != 0)
        digits[count++] = '0';
    for (; value; value /= base) {
        char digit = (char)(value % base);
        digits[count++] = (char)(digit + (digit < 10 ? '0' : letters));
    }
    if (base == 8 && spec->flags & ALTERNATE && (count == 0 || digits[count - 1] != '0'))
        digits[count++] = '0';
    __format_field(sink, spec, prefix, digits, count);
}
