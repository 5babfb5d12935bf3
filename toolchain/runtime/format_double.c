/* SPDX-License-Identifier: MIT */
/* %f %e %g (C11 7.21.6.1): prints a double as exact decimal digits, rounded to nearest, ties to even.
 *
 * A double is an integer plus a fraction, both in 16-bit limbs. Divisions split the integer into groups of four decimal
 * digits; multiplying the fraction by 10^4 yields its next group. Both are on the stack, with a length that depends on
 * the exponent: 30 bytes below 2^64, 300 for 1e308. */
#include "format.h"
#include "softfloat.h"
#include "stack_room.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#define SIGNIFICAND_BITS 53
#define BIAS 1075 /* of the exponent, for a significand that is an integer */
#define LIMB 16
#define GROUP 10000u
#define MOST_DIGITS 1100 /* maximum number of decimals printed; a double has at most 1074 */

/* Generator of the digits of a number, first digit first. */
typedef struct {
    const uint16_t *groups; /* digit groups of the integer, lowest first */
    uint16_t *fraction;     /* limbs of the fraction, lowest first */
    int left, low, limbs;   /* groups left; lowest limb that is not 0; number of limbs */
    uint16_t group, power;  /* remaining digits of the current group; weight of the next digit, or 0 */
} digits_t;

/* Multiply the fraction by 10^4; return the carry out of it. */
static uint16_t next_group(digits_t *d)
{
    uint16_t carry = 0;
    for (int i = d->low; i < d->limbs; i++) {
        uint32_t product = (uint32_t)d->fraction[i] * GROUP + carry;
        d->fraction[i] = (uint16_t)product;
        carry = (uint16_t)(product >> LIMB);
    }
    while (d->low < d->limbs && !d->fraction[d->low])
        d->low++;
    return carry;
}

static char next_digit(digits_t *d)
{
    if (!d->power) {
        d->group = d->left ? d->groups[--d->left] : next_group(d);
        d->power = 1000;
    }
    char digit = (char)(d->group / d->power);
    d->group %= d->power;
    d->power /= 10;
    return digit;
}

static int anything_left(const digits_t *d)
{
    for (int i = 0; i < d->left; i++)
        if (d->groups[i])
            return 1;
    return d->group || d->low < d->limbs;
}

/* Store significand * 2^shift in `limbs` limbs, which are 0 before; shift >= 0. */
static void place(uint16_t *limbs, uint64_t significand, int shift)
{
    uint16_t *at = limbs + shift / LIMB;
    shift %= LIMB;
    uint64_t rest = significand << shift;
    for (int i = 0; i < 4; i++, rest >>= LIMB)
        *at++ = (uint16_t)rest;
    if (shift) /* bits shifted out of the low 64 bits */
        *at = (uint16_t)(significand >> (64 - shift));
}

/* Split the integer of `count` limbs into groups of four digits; return the number of groups. */
static int into_groups(uint16_t *integer, int count, uint16_t *groups)
{
    int made = 0;
    for (;;) {
        while (count && !integer[count - 1])
            count--;
        if (!count)
            return made;
        uint16_t rest = 0;
        for (int i = count - 1; i >= 0; i--) {
            uint32_t dividend = (uint32_t)rest << LIMB | integer[i];
            integer[i] = (uint16_t)(dividend / GROUP);
            rest = (uint16_t)(dividend % GROUP);
        }
        groups[made++] = rest;
    }
}

/* Round `count` digits by the following ones. Return 1 if all have become 0 and a 1 must precede them. */
static int round_off(char *digits, int count, digits_t *rest)
{
    char next = next_digit(rest);
    int odd = count > 0 && digits[count - 1] & 1;
    if (next < 5 || (next == 5 && !odd && !anything_left(rest)))
        return 0;
    while (count > 0) {
        if (++digits[--count] < 10)
            return 0;
        digits[count] = 0;
    }
    return 1;
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

/* Print a field: `padding` characters precede the sign, are zeros after the sign, or follow the number. */
static void put_sign(sink_t *sink, unsigned char flags, char sign, int padding)
{
    if (!(flags & (LEFT | ZERO)))
        __format_pad(sink, ' ', padding);
    if (sign)
        sink->put(sink, sign);
    if ((flags & (LEFT | ZERO)) == ZERO)
        __format_pad(sink, '0', padding);
}

static void put_infinite(sink_t *sink, const spec_t *spec, char sign, double x)
{
    const char *text = isnan(x) ? "nan" : "inf";
    int padding = spec->width - 3 - (sign != 0);
    put_sign(sink, spec->flags & (unsigned char)~ZERO, sign, padding);
    for (int i = 0; i < 3; i++)
        sink->put(sink, (char)(spec->conversion & 0x20 ? text[i] : text[i] & ~0x20));
    if (spec->flags & LEFT)
        __format_pad(sink, ' ', padding);
}

/* Print `count` digits, the first of weight 10^exponent, in fixed or scientific form with `places` decimals. */
static void put_number(sink_t *sink, const spec_t *spec, char sign, const char *digits, int count, int exponent,
                       int places, int scientific)
{
    int whole = scientific ? 1 : exponent < 0 ? 1 : exponent + 1;
    int point = places > 0 || spec->flags & ALTERNATE, letters = 0;
    char power[5];
    if (scientific)
        letters = put_exponent(power, exponent, (char)('E' | (spec->conversion & 0x20)));
    int padding = spec->width - (sign != 0) - whole - (point != 0) - places - letters;
    put_sign(sink, spec->flags, sign, padding);
    int at = scientific ? 0 : exponent < 0 ? exponent : 0; /* index of the first digit to print */
    for (int i = 0; i < whole + places; i++, at++) {
        if (i == whole)
            sink->put(sink, '.');
        sink->put(sink, (char)('0' + (at >= 0 && at < count ? digits[at] : 0)));
    }
    if (point && !places)
        sink->put(sink, '.');
    for (int i = 0; i < letters; i++)
        sink->put(sink, power[i]);
    if (spec->flags & LEFT)
        __format_pad(sink, ' ', padding);
}

void __format_double(sink_t *sink, const spec_t *spec, double value)
{
    char lower = (char)(spec->conversion | 0x20);
    char sign = (char)(signbit(value) ? '-' : spec->flags & PLUS ? '+' : spec->flags & SPACE ? ' ' : 0);
    if (!isfinite(value)) {
        put_infinite(sink, spec, sign, value);
        return;
    }
    uint64_t significand;
    memcpy(&significand, &value, sizeof significand);
    int power = (int)(significand >> (SIGNIFICAND_BITS - 1) & 0x7FF);
    significand &= (UINT64_C(1) << (SIGNIFICAND_BITS - 1)) - 1;
    if (power)
        significand |= UINT64_C(1) << (SIGNIFICAND_BITS - 1);
    else
        power = 1;
    power -= BIAS; /* |value| = significand * 2^power */

    int below = power < 0 ? -power : 0, above = power > 0 ? power : 0;
    int limbs = (below + LIMB - 1) / LIMB + 1, count = (above + SIGNIFICAND_BITS) / LIMB + 2;
    STACK_ROOM(((unsigned)limbs + 5 + 2 * (unsigned)count + (unsigned)count / 4) * sizeof(uint16_t));
    uint16_t fraction[limbs + 4], integer[count], groups[count + count / 4 + 1];
    memset(fraction, 0, sizeof fraction);
    memset(integer, 0, sizeof integer);
    uint64_t whole_part = below >= 64 ? 0 : significand >> below;
    uint64_t rest = below >= 64 ? significand : significand - (whole_part << below);
    place(integer, whole_part, above);
    limbs--;
    place(fraction, rest, limbs * LIMB - below);
    digits_t source = {groups, fraction, into_groups(integer, count, groups), 0, limbs, 0, 0};
    while (source.low < limbs && !fraction[source.low])
        source.low++;

    /* Find the first digit that is not 0, and its weight. */
    int exponent = 4 * source.left - 1, zero = !significand;
    char first = zero ? 0 : next_digit(&source);
    for (; !first && !zero; exponent--)
        first = next_digit(&source);
    if (zero)
        exponent = 0;

    int places = spec->precision < 0 ? 6 : spec->precision;
    if (lower == 'g' && !places)
        places = 1;
    int wanted = lower == 'e' ? places + 1 : lower == 'g' ? places : exponent + 1 + places;
    int kept = wanted > MOST_DIGITS ? MOST_DIGITS : wanted < 0 ? 0 : wanted;
    STACK_ROOM((unsigned)kept + 1);
    char digits[kept + 1];
    memset(digits, 0, sizeof digits);
    if (kept) {
        digits[0] = first;
        for (int i = 1; i < kept; i++)
            digits[i] = next_digit(&source);
    } else { /* no digit is printed; the first one decides rounding */
        source.group += first * (source.power ? source.power * 10 : 1);
        source.power = source.power ? source.power * 10 : 1;
    }
    if (wanted >= 0 && round_off(digits, kept, &source)) {
        if (lower == 'f')
            kept++;
        memmove(digits + 1, digits, (unsigned)(kept ? kept - 1 : 0));
        digits[0] = 1;
        exponent++;
    }
    int scientific = lower == 'e';
    if (lower == 'g') {
        scientific = exponent < -4 || exponent >= places;
        int shown = kept;
        if (!(spec->flags & ALTERNATE))
            while (shown > 1 && !digits[shown - 1])
                shown--;
        else
            shown = places;
        places = scientific ? shown - 1 : shown - 1 - exponent;
        if (places < 0)
            places = 0;
    }
    put_number(sink, spec, sign, digits, kept, exponent, places, scientific);
}
