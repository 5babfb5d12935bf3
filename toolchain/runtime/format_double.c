/* %f %e %g (C11 7.21.6.1): a double as decimal digits.
 *
 * Numbers from 2^-11 up to 2^64 are split exactly into 64-bit integer and fraction, so their digits are exact and
 * rounded to nearest, ties to even. Others are first scaled by a power of ten in double arithmetic, which can change
 * the digits from the 15th on. Precision above 17 is filled with zeros. */
#include "format.h"
#include "softfloat.h"

#include <math.h>

#define DIGITS 40 /* 20 of a 64-bit integer and 20 more */
#define MOST_PLACES 17

typedef struct {
    char text[DIGITS]; /* digits, most significant first */
    int count;
    int whole; /* how many stand before the decimal point */
} decimal_t;

/* One more unit in the last digit. */
static void increment(decimal_t *number)
{
    int at = number->count;
    while (at > 0) {
        if (number->text[--at] != '9') {
            number->text[at]++;
            return;
        }
        number->text[at] = '0';
    }
    for (at = number->count; at > 0; at--)
        number->text[at] = number->text[at - 1];
    number->text[0] = '1';
    number->count++;
    number->whole++;
}

/* x in [2^-11, 2^64) or 0 as digits with `places` decimals. */
static void to_decimal(decimal_t *number, double x, int places)
{
    unsigned long long integer = (unsigned long long)x;
    unsigned long long fraction = 0; /* in units of 2^-64 */
    double rest = x - (double)integer;
    if (rest > 0)
        fraction = (unsigned long long)ldexp(rest, 64);
    char reversed[20];
    int count = 0;
    for (; integer; integer /= 10)
        reversed[count++] = (char)('0' + (char)(integer % 10));
    number->count = 0;
    number->whole = count;
    while (count)
        number->text[number->count++] = reversed[--count];
    for (; places > 0; places--) { /* fraction *= 10; the digit is what overflows */
        unsigned long long low = (fraction & 0xFFFFFFFF) * 10;
        unsigned long long high = (fraction >> 32) * 10 + (low >> 32);
        fraction = high << 32 | (low & 0xFFFFFFFF);
        number->text[number->count++] = (char)('0' + (char)(high >> 32));
    }
    int odd = number->count ? number->text[number->count - 1] & 1 : 0;
    if (fraction > F64_SIGN || (fraction == F64_SIGN && odd))
        increment(number);
}

/* Scale x > 0 by a power of ten into [1, 10); returns the decimal exponent. */
static int normalise(double *x)
{
    static const double powers[] = {1e1, 1e2, 1e4, 1e8, 1e16, 1e32, 1e64, 1e128, 1e256};
    int exponent = 0;
    for (int i = 8; i >= 0; i--) {
        if (*x >= powers[i]) {
            *x /= powers[i];
            exponent += 1 << i;
        }
    }
    for (int i = 8; i >= 0; i--) {
        if (*x * powers[i] < 10) {
            *x *= powers[i];
            exponent -= 1 << i;
        }
    }
    return exponent;
}

static void emit(sink_t *sink, const spec_t *spec, char sign, const char *text, int length)
{
    int padding = spec->width - length - (sign != 0);
    if (!(spec->flags & (LEFT | ZERO)))
        __format_pad(sink, ' ', padding);
    if (sign)
        sink->put(sink, sign);
    if ((spec->flags & (LEFT | ZERO)) == ZERO)
        __format_pad(sink, '0', padding);
    for (int i = 0; i < length; i++)
        sink->put(sink, text[i]);
    if (spec->flags & LEFT)
        __format_pad(sink, ' ', padding);
}

static int put_exponent(char *to, int exponent, char letter)
{
    int length = 0;
    to[length++] = letter;
    to[length++] = exponent < 0 ? '-' : '+';
    if (exponent < 0)
        exponent = -exponent;
    if (exponent >= 100)
        to[length++] = (char)('0' + exponent / 100);
    to[length++] = (char)('0' + exponent / 10 % 10);
    to[length++] = (char)('0' + exponent % 10);
    return length;
}

/* Digits with a decimal point behind the first `whole` ones; `zeros` more decimals follow. Returns the length. */
static int put_fixed(char *to, const decimal_t *number, int whole, int zeros, int point)
{
    int length = 0;
    if (whole <= 0)
        to[length++] = '0';
    for (int i = 0; i < whole; i++)
        to[length++] = number->text[i];
    if (number->count > whole || zeros || point)
        to[length++] = '.';
    for (int i = whole; i < number->count; i++)
        to[length++] = i < 0 ? '0' : number->text[i];
    while (zeros-- > 0)
        to[length++] = '0';
    return length;
}

static int without_trailing_zeros(const char *text, int length)
{
    while (text[length - 1] == '0')
        length--;
    return text[length - 1] == '.' ? length - 1 : length;
}

void __format_double(sink_t *sink, const spec_t *spec, double value)
{
    char lower = (char)(spec->conversion | 0x20), upper_case = (char)(spec->conversion ^ lower);
    char sign = (char)(signbit(value) ? '-' : spec->flags & PLUS ? '+' : spec->flags & SPACE ? ' ' : 0);
    double x = fabs(value);
    if (!isfinite(x)) {
        spec_t plain = *spec;
        plain.flags &= (unsigned char)~ZERO;
        const char *text = isnan(x) ? upper_case ? "NAN" : "nan" : upper_case ? "INF" : "inf";
        emit(sink, &plain, sign, text, 3);
        return;
    }
    char text[64];
    int places = spec->precision < 0 ? 6 : spec->precision, length;
    decimal_t number;
    int scientific = lower == 'e', strip = 0, exponent = 0;
    double scaled = x;
    if (x != 0)
        exponent = normalise(&scaled);
    if (lower == 'g') {
        if (places == 0)
            places = 1;
        to_decimal(&number, scaled, places - 1 > MOST_PLACES ? MOST_PLACES : places - 1);
        if (x != 0)
            exponent += number.whole - 1;
        scientific = exponent < -4 || exponent >= places;
        places = scientific ? places - 1 : places - 1 - exponent;
        strip = !(spec->flags & ALTERNATE);
    }
    int zeros = places > MOST_PLACES ? places - MOST_PLACES : 0;
    if (zeros > 20)
        zeros = 20;
    if (zeros)
        places = MOST_PLACES;
    if (scientific) {
        to_decimal(&number, scaled, places);
        if (lower == 'e' && x != 0)
            exponent += number.whole - 1;
        number.count = places + (x != 0);
        if (x == 0)
            number.whole = 0;
        length = put_fixed(text, &number, x != 0, zeros, spec->flags & ALTERNATE);
        if (strip && places + zeros > 0)
            length = without_trailing_zeros(text, length);
        length += put_exponent(text + length, exponent, spec->conversion == 'E' || spec->conversion == 'G' ? 'E' : 'e');
    } else if (x < 18446744073709551616.0) {
        to_decimal(&number, x, places);
        length = put_fixed(text, &number, number.whole, zeros, spec->flags & ALTERNATE);
        if (strip && places + zeros > 0)
            length = without_trailing_zeros(text, length);
    } else {
        /* 17 digits, then zeros: no buffer for 309 digits */
        to_decimal(&number, scaled, MOST_PLACES - 1);
        exponent += number.whole - 1;
        int padding = spec->width - (exponent + 1) - (places ? places + 1 : 0) - (sign != 0);
        if (!(spec->flags & LEFT))
            __format_pad(sink, spec->flags & ZERO ? '0' : ' ', padding);
        if (sign)
            sink->put(sink, sign);
        for (int i = 0; i <= exponent; i++)
            sink->put(sink, i < number.count ? number.text[i] : '0');
        if (places + zeros) {
            sink->put(sink, '.');
            __format_pad(sink, '0', places + zeros);
        }
        if (spec->flags & LEFT)
            __format_pad(sink, ' ', padding);
        return;
    }
    emit(sink, spec, sign, text, length);
}
