/* SPDX-License-Identifier: MIT */
/* Body of strtod and strtof (C11 7.22.1.3): converts a text to the nearest number of a format, ties to even. The
 * including file describes the format: NUMBER is its type, BITS_T an integer of its size, the others are constants.
 *
 * Few digits with a small power of ten take one exact multiplication or division. For other numbers the function makes
 * an estimate and compares the exact value with the midpoint to the next number, until the estimate is the nearest
 * number. The exact integers are on the stack, with a length that depends on the number. */
#include "stack_room.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define LIMB 16
#define MIDDLE_BIT_BIAS (2 - LOWEST_POWER) /* exponent of half of the last bit of a subnormal */

typedef struct {
    uint16_t *limbs; /* least significant first */
    int count;
} integer_t;

/* Compute x = x * factor + addend. */
static void multiply(integer_t *x, uint16_t factor, uint16_t addend)
{
    uint16_t carry = addend;
    for (int i = 0; i < x->count; i++) {
        uint32_t product = (uint32_t)x->limbs[i] * factor + carry;
        x->limbs[i] = (uint16_t)product;
        carry = (uint16_t)(product >> LIMB);
    }
    if (carry)
        x->limbs[x->count++] = carry;
}

static void multiply_by_power(integer_t *x, uint16_t base, int power)
{
    for (; power > 0; power--)
        multiply(x, base, 0);
}

static void shift(integer_t *x, int bits)
{
    int whole = bits / LIMB;
    if (!x->count)
        return;
    memmove(x->limbs + whole, x->limbs, (unsigned)x->count * sizeof *x->limbs);
    memset(x->limbs, 0, (unsigned)whole * sizeof *x->limbs);
    x->count += whole;
    multiply(x, (uint16_t)(1u << bits % LIMB), 0);
}

static int compare(const integer_t *a, const integer_t *b)
{
    if (a->count != b->count)
        return a->count < b->count ? -1 : 1;
    for (int i = a->count - 1; i >= 0; i--)
        if (a->limbs[i] != b->limbs[i])
            return a->limbs[i] < b->limbs[i] ? -1 : 1;
    return 0;
}

/* Return the sign of digits * 10^power - (midpoint between the number with the given bits and the next larger one). */
static int against_middle(const char *digits, int count, int power, int more, BITS_T bits)
{
    int exponent = (int)(bits >> (PRECISION - 1));
    BITS_T middle = bits & (((BITS_T)1 << (PRECISION - 1)) - 1);
    if (exponent)
        middle |= (BITS_T)1 << (PRECISION - 1);
    else
        exponent = 1;
    middle = middle * 2 + 1;
    exponent -= MIDDLE_BIT_BIAS;
    int tens = power < 0 ? -power : power, twos = exponent < 0 ? -exponent : exponent;
    uint16_t left[(count * 4 + (power > 0 ? tens * 4 : 0) + (exponent < 0 ? twos : 0)) / LIMB + 3];
    uint16_t right[(64 + (power < 0 ? tens * 4 : 0) + (exponent > 0 ? twos : 0)) / LIMB + 3];
    integer_t number = {left, 0}, half = {right, 0};
    for (int i = 0; i < count; i++)
        multiply(&number, 10, (uint16_t)(digits[i] - '0'));
    for (; middle; middle >>= LIMB)
        right[half.count++] = (uint16_t)middle;
    integer_t *scaled = power < 0 ? &half : &number;
    multiply_by_power(scaled, 10000, tens / 4);
    multiply_by_power(scaled, 10, tens % 4);
    shift(exponent < 0 ? &number : &half, twos);
    int sign = compare(&number, &half);
    return sign ? sign : more;
}

static NUMBER from_bits(BITS_T bits)
{
    NUMBER value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Return the number nearest to digits * 10^power; `more`: omitted digits after them are not all 0. */
static NUMBER nearest(const char *digits, int count, int power, int more)
{
    static const NUMBER powers[] = {POWERS_OF_TEN};
    NUMBER guess = 0;
    int guessed = count < GUESSED_DIGITS ? count : GUESSED_DIGITS;
    for (int i = 0; i < guessed; i++)
        guess = guess * 10 + (digits[i] - '0');
    int scale = power + count - guessed, size = scale < 0 ? -scale : scale;
    if (count <= EXACT_DIGITS && !more && size <= EXACT_POWER) {
        NUMBER ten = 1;
        for (int i = 0; i < EXACT_POWERS; i++)
            if (size >> i & 1)
                ten *= powers[i];
        return scale < 0 ? guess / ten : guess * ten;
    }
    if (count + power > LARGEST_POWER)
        return HUGE_NUMBER;
    if (count + power < SMALLEST_POWER)
        return 0;
    for (int i = (int)(sizeof powers / sizeof *powers) - 1; i >= 0; i--)
        for (; size >= 1 << i; size -= 1 << i)
            guess = scale < 0 ? guess / powers[i] : guess * powers[i];
    BITS_T bits;
    memcpy(&bits, &guess, sizeof bits);
    if (!isfinite(guess))
        bits--; /* the largest number */
    for (;;) { /* down while the number is below the lower midpoint of the estimate, up while above the upper one */
        int over = against_middle(digits, count, power, more, bits);
        if (over > 0 || (over == 0 && bits & 1)) {
            bits++;
            if (!isfinite(from_bits(bits)))
                return HUGE_NUMBER;
            continue;
        }
        if (!bits)
            return 0;
        int under = against_middle(digits, count, power, more, bits - 1);
        if (under > 0 || (under == 0 && !(bits & 1)))
            return from_bits(bits);
        bits--;
    }
}

static int hexadecimal(char character)
{
    if (isdigit((unsigned char)character))
        return character - '0';
    character = (char)(character | 0x20);
    return character >= 'a' && character <= 'f' ? character - 'a' + 10 : -1;
}

/* Read a decimal exponent after the letter at `at`, if any; return the end of the number. */
static const char *read_power(const char *at, char letter, long *power)
{
    if ((*at | 0x20) != letter)
        return at;
    const char *from = at + 1;
    int negative = *from == '-';
    if (*from == '-' || *from == '+')
        from++;
    if (!isdigit((unsigned char)*from))
        return at;
    long value = 0;
    for (; isdigit((unsigned char)*from); from++)
        if (value < 100000)
            value = value * 10 + (*from - '0');
    *power += negative ? -value : value;
    return from;
}

/* Read the text after 0x: hexadecimal digits with a point, power of two. Return NULL if there is no digit. */
static const char *read_hexadecimal(const char *at, NUMBER *value)
{
    BITS_T significand = 0;
    long power = 0;
    int point = 0, any = 0;
    for (;; at++) {
        int digit = hexadecimal(*at);
        if (digit < 0 && (*at != '.' || point))
            break;
        if (digit < 0) {
            point = 1;
            continue;
        }
        any = 1;
        if (significand >> (WIDTH - 6)) { /* full: further digits only decide ties */
            significand |= digit != 0;
            power += point ? 0 : 4;
        } else {
            significand = significand << 4 | (unsigned)digit;
            power -= point ? 4 : 0;
        }
    }
    if (!any)
        return NULL;
    at = read_power(at, 'p', &power);
    if (power > 2000)
        power = 2000;
    if (power < -2000)
        power = -2000;
    int below = (int)power;
    int bits = WIDTH - 1;
    while (bits && !(significand >> (bits - 1)))
        bits--;
    int lost = bits + below < LOWEST_POWER + PRECISION ? LOWEST_POWER - below : bits - PRECISION; /* bits beyond the significand */
    if (lost > bits) {
        significand = 0;
    } else if (lost > 0) { /* a significand has WIDTH - 2 bits at most */
        BITS_T rest = significand & (((BITS_T)1 << lost) - 1), half = (BITS_T)1 << (lost - 1);
        significand >>= lost;
        below += lost;
        significand += rest > half || (rest == half && significand & 1);
    }
    *value = SCALE((NUMBER)significand, below);
    return at;
}

static int same_word(const char *text, const char *word)
{
    int length = 0;
    for (; word[length]; length++)
        if ((text[length] | 0x20) != word[length])
            return 0;
    return length;
}

/* Read digits, point and exponent at `at`; return NULL if there is no digit. */
static const char *read_decimal(const char *at, NUMBER *value)
{
    long power = 0;
    int count = 0, more = 0, any = 0, point = 0;
    const char *first = at;
    for (;; at++) { /* count the digits from the first that is not 0 */
        if (*at == '.' && !point) {
            point = 1;
            continue;
        }
        if (!isdigit((unsigned char)*at))
            break;
        any = 1;
        if (count || *at != '0') {
            if (!count)
                first = at;
            count++;
        }
        power -= point;
    }
    if (!any)
        return NULL;
    const char *end = read_power(at, 'e', &power);
    while (count && at > first && (at[-1] == '0' || at[-1] == '.')) { /* trailing zeros increase the power */
        if (*--at == '0') {
            count--;
            power++;
        }
    }
    int kept = count < MOST_DIGITS ? count : MOST_DIGITS;
    STACK_ROOM((unsigned)kept + 1);
    char digits[kept + 1];
    for (int i = 0; i < kept; first++)
        if (*first != '.')
            digits[i++] = *first;
    more = count > kept;
    power += count - kept;
    if (!count)
        *value = 0;
    else if (power > 30000)
        *value = HUGE_NUMBER;
    else if (power < -30000)
        *value = 0;
    else
        *value = nearest(digits, kept, (int)power, more);
    if (count && (*value == HUGE_NUMBER || *value == 0))
        errno = ERANGE;
    return end;
}

NUMBER STRING_TO_NUMBER(const char *restrict text, char **restrict end)
{
    const char *at = text, *after;
    NUMBER value = 0;
    while (isspace((unsigned char)*at))
        at++;
    int negative = *at == '-', length;
    if (*at == '-' || *at == '+')
        at++;
    if (same_word(at, "inf")) {
        length = same_word(at, "infinity");
        value = HUGE_NUMBER;
        after = at + (length ? length : 3);
    } else if (same_word(at, "nan")) {
        value = (NUMBER)NAN;
        after = at + 3;
        if (*after == '(') { /* n-char-sequence of NaN, which is ignored */
            const char *inside = after + 1;
            while (isalnum((unsigned char)*inside) || *inside == '_')
                inside++;
            if (*inside == ')')
                after = inside + 1;
        }
    } else if (*at == '0' && (at[1] | 0x20) == 'x' && (after = read_hexadecimal(at + 2, &value))) {
        ; /* done */
    } else {
        after = read_decimal(at, &value);
    }
    if (end)
        *end = (char *)(after ? after : text);
    return negative && after ? -value : value;
}
