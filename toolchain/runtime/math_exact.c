/* SPDX-License-Identifier: MIT */
/* Further functions of math.h that are exact or correctly rounded: rounding to integers in the current mode, scaling,
 * neighbours, remainders, fused products (C11 7.12.6, 7.12.9-7.12.13), in both precisions. The only rounding mode
 * is to nearest. */
#include "softfloat.h"

#include <float.h>
#include <limits.h>
#include <math.h>

/* Least double and float from which on all values are integers. */
#define WHOLE 4503599627370496.0
#define WHOLE_F 8388608.0f

#define LOW_HALF 0xFFFFFFFFULL

double rint(double x)
{
    double size = fabs(x);
    if (!(size < WHOLE))
        return x;
    volatile double rounded = size + WHOLE; /* the addition rounds */
    return copysign(rounded - WHOLE, x);
}

float rintf(float x)
{
    float size = fabsf(x);
    if (!(size < WHOLE_F))
        return x;
    volatile float rounded = size + WHOLE_F;
    return copysignf(rounded - WHOLE_F, x);
}

double nearbyint(double x)
{
    return rint(x);
}

float nearbyintf(float x)
{
    return rintf(x);
}

long lrint(double x)
{
    return (long)rint(x);
}

long lrintf(float x)
{
    return (long)rintf(x);
}

long long llrint(double x)
{
    return (long long)rint(x);
}

long long llrintf(float x)
{
    return (long long)rintf(x);
}

long lround(double x)
{
    return (long)round(x);
}

long lroundf(float x)
{
    return (long)roundf(x);
}

long long llround(double x)
{
    return (long long)round(x);
}

long long llroundf(float x)
{
    return (long long)roundf(x);
}

double logb(double x)
{
    if (x == 0)
        return -HUGE_VAL;
    return isfinite(x) ? ilogb(x) : x * x; /* +infinity for both infinities, NaN for NaN */
}

float logbf(float x)
{
    if (x == 0)
        return -HUGE_VALF;
    return isfinite(x) ? (float)ilogbf(x) : x * x;
}

double scalbn(double x, int exponent)
{
    return ldexp(x, exponent);
}

float scalbnf(float x, int exponent)
{
    return ldexpf(x, exponent);
}

static int as_int(long exponent)
{
    return exponent > INT_MAX ? INT_MAX : exponent < INT_MIN ? INT_MIN : (int)exponent;
}

double scalbln(double x, long exponent)
{
    return ldexp(x, as_int(exponent));
}

float scalblnf(float x, long exponent)
{
    return ldexpf(x, as_int(exponent));
}

/* For one sign, bit patterns increase with the magnitude. */
double nextafter(double x, double towards)
{
    uint64_t bits = f64_bits(x);
    if (isnan(x) || isnan(towards))
        return f64_value(F64_NAN);
    if (x == towards)
        return towards;
    if (x == 0)
        return f64_value((f64_bits(towards) & F64_SIGN) | 1);
    return f64_value((x < towards) == (x > 0) ? bits + 1 : bits - 1);
}

double nexttoward(double x, long double towards)
{
    return nextafter(x, (double)towards);
}

float nexttowardf(float x, long double towards)
{
    uint32_t bits = f32_bits(x);
    if (isnan(x) || isnan(towards))
        return f32_value(F32_NAN);
    if (x == towards)
        return (float)towards;
    if (x == 0)
        return f32_value((towards < 0 ? F32_SIGN : 0) | 1);
    return f32_value((x < towards) == (x > 0) ? bits + 1 : bits - 1);
}

float nextafterf(float x, float towards)
{
    return nexttowardf(x, towards);
}

double remquo(double x, double y, int *quotient)
{
    double rest = fabs(x), divisor = fabs(y);
    int whole = 0;
    *quotient = 0;
    if (isnan(y) || !isfinite(x) || y == 0)
        return f64_value(F64_NAN);
    if (divisor <= DBL_MAX / 8) /* for larger divisors the quotient is below 8 */
        rest = fmod(rest, 8 * divisor);
    for (int times = 4; times > 1; times /= 2)
        if (divisor <= DBL_MAX / times && rest >= times * divisor) {
            rest -= times * divisor;
            whole += times;
        }
    if (rest >= divisor) {
        rest -= divisor;
        whole++;
    }
    double missing = divisor - rest; /* exact, or far from `rest` */
    if (rest > missing || (rest == missing && whole & 1)) {
        rest = -missing;
        whole++;
    }
    whole &= 7;
    *quotient = signbit(x) != signbit(y) ? -whole : whole;
    return rest == 0 ? copysign(0, x) : signbit(x) ? -rest : rest;
}

float remquof(float x, float y, int *quotient)
{
    return (float)remquo(x, y, quotient); /* double is exact, and float can represent the result */
}

double remainder(double x, double y)
{
    int quotient;
    return remquo(x, y, &quotient);
}

float remainderf(float x, float y)
{
    int quotient;
    return (float)remquo(x, y, &quotient);
}

double fdim(double x, double y)
{
    return x <= y ? 0 : x - y;
}

float fdimf(float x, float y)
{
    return x <= y ? 0 : x - y;
}

double nan(const char *payload)
{
    (void)payload;
    return f64_value(F64_NAN);
}

float nanf(const char *payload)
{
    (void)payload;
    return f32_value(F32_NAN);
}

/* Number with a 128-bit significand, whose leading one is bit 126, and a biased exponent. */
typedef struct {
    uint64_t high, low;
    int16_t exponent;
} wide_t;

static void shift_left(wide_t *a, int16_t count)
{
    for (; count > 0; count--) {
        a->high = a->high << 1 | a->low >> 63;
        a->low <<= 1;
        a->exponent--;
    }
}

/* Shift right; bits shifted out set the lowest bit. */
static void shift_right(wide_t *a, int16_t count)
{
    a->exponent = (int16_t)(a->exponent + count);
    if (count >= 64) {
        a->low = __f64_shift_sticky(a->high | (a->low != 0), (int16_t)(count - 64));
        a->high = 0;
    } else if (count) {
        uint64_t lost = a->low << (64 - count);
        a->low = a->high << (64 - count) | a->low >> count | (lost != 0);
        a->high >>= count;
    }
}

/* Return |x| * |y| for finite numbers that are not 0: exact, because the low 11 bits of both are 0. */
static wide_t product_of(uint64_t x, uint64_t y)
{
    int16_t left, right;
    uint64_t a = __f64_unpack(x & ~F64_SIGN, &left), b = __f64_unpack(y & ~F64_SIGN, &right);
    uint64_t a_high = a >> 32, a_low = a & LOW_HALF, b_high = b >> 32, b_low = b & LOW_HALF;
    uint64_t low = a_low * b_low, cross = a_high * b_low + (low >> 32), other = a_low * b_high + (cross & LOW_HALF);
    wide_t p = {a_high * b_high + (cross >> 32) + (other >> 32), other << 32 | (low & LOW_HALF),
                (int16_t)(left + right - F64_BIAS)};
    if (p.high & F64_SIGN)
        shift_right(&p, 1);
    return p;
}

/* Return x * y + z, computed exactly and rounded once. */
double fma(double x, double y, double z)
{
    if (!isfinite(x) || !isfinite(y) || x == 0 || y == 0)
        return x * y + z;
    if (!isfinite(z))
        return z;
    if (z == 0)
        return x * y;
    uint64_t sign = (f64_bits(x) ^ f64_bits(y)) & F64_SIGN, sign_z = f64_bits(z) & F64_SIGN;
    wide_t large = product_of(f64_bits(x), f64_bits(y)), small = {0, 0, 0};
    small.high = __f64_unpack(f64_bits(z) & ~F64_SIGN, &small.exponent) >> 1;
    int differ = sign != sign_z;
    if (small.exponent > large.exponent ||
        (small.exponent == large.exponent &&
         (small.high > large.high || (small.high == large.high && small.low > large.low)))) {
        wide_t other = large;
        large = small;
        small = other;
        sign = sign_z;
    }
    shift_right(&small, (int16_t)(large.exponent - small.exponent));
    if (differ) {
        large.high -= small.high + (large.low < small.low);
        large.low -= small.low;
        if (!(large.high | large.low))
            return 0;
        int16_t zeros = large.high ? __f64_leading_zeros(large.high) : (int16_t)(64 + __f64_leading_zeros(large.low));
        shift_left(&large, (int16_t)(zeros - 1));
    } else {
        large.low += small.low;
        large.high += small.high + (large.low < small.low);
        if (large.high & F64_SIGN)
            shift_right(&large, 1);
    }
    return f64_value(__f64_pack(sign, large.exponent, large.high | (large.low != 0)));
}

/* The product is exact in double. The sum with z is rounded to odd in double and then to single. The result is correct,
 * because double has more than two additional bits. */
float fmaf(float x, float y, float z)
{
    double product = (double)x * y, sum = product + z;
    if (isfinite(sum)) {
        double part = sum - product, error = (product - (sum - part)) + (z - part);
        uint64_t bits = f64_bits(sum);
        if (error != 0 && !(bits & 1))
            sum = f64_value((error > 0) == (sum > 0) ? bits + 1 : bits - 1);
    }
    return (float)sum;
}
