/* SPDX-License-Identifier: MIT */
/* Functions of math.h that work on the bits of a double: rounding to integers, parts, remainders (C11 7.12.6-7.12.12).
 * All are exact. */
#include "softfloat.h"

#include <math.h>

double fabs(double x)
{
    return f64_value(f64_bits(x) & ~F64_SIGN);
}

double copysign(double magnitude, double sign)
{
    return f64_value((f64_bits(magnitude) & ~F64_SIGN) | (f64_bits(sign) & F64_SIGN));
}

/* Return the mask of the fraction bits of x: all ones if |x| < 1, 0 if x has no fraction bits, is infinite or NaN. */
static uint64_t fraction_mask(uint64_t bits)
{
    int16_t exponent = (int16_t)((int16_t)(bits >> 52 & 0x7FF) - F64_BIAS);
    if (exponent < 0)
        return ~F64_SIGN;
    return exponent >= 52 ? 0 : F64_MANTISSA >> exponent;
}

double trunc(double x)
{
    uint64_t bits = f64_bits(x);
    return f64_value(bits & ~fraction_mask(bits));
}

double floor(double x)
{
    double whole = trunc(x);
    return whole > x ? whole - 1 : whole;
}

double ceil(double x)
{
    uint64_t sign = f64_bits(x) & F64_SIGN;
    double whole = trunc(x);
    return whole < x ? f64_value(f64_bits(whole + 1) | sign) : whole;
}

double round(double x)
{
    uint64_t bits = f64_bits(x);
    double whole = trunc(x);
    double rest = fabs(x - whole);
    if (rest >= 0.5)
        return f64_value(f64_bits(fabs(whole) + 1) | (bits & F64_SIGN));
    return whole;
}

double modf(double x, double *whole)
{
    *whole = trunc(x);
    return copysign(*whole == x ? 0 : x - *whole, x);
}

double frexp(double x, int *exponent)
{
    uint64_t bits = f64_bits(x), magnitude = bits & ~F64_SIGN;
    *exponent = 0;
    if (magnitude == 0 || magnitude >= F64_INF)
        return x;
    int16_t biased;
    uint64_t significand = __f64_unpack(magnitude, &biased);
    *exponent = biased - (F64_BIAS - 1);
    return f64_value((bits & F64_SIGN) | (uint64_t)(F64_BIAS - 1) << 52 | (significand >> 11 & F64_MANTISSA));
}

int ilogb(double x)
{
    uint64_t magnitude = f64_bits(x) & ~F64_SIGN;
    if (magnitude == 0)
        return FP_ILOGB0;
    if (magnitude >= F64_INF)
        return magnitude > F64_INF ? FP_ILOGBNAN : __INT_MAX__;
    int16_t biased;
    __f64_unpack(magnitude, &biased);
    return biased - F64_BIAS;
}

int ilogbl(long double x)
{
    return ilogb((double)x);
}

double ldexp(double x, int exponent)
{
    uint64_t bits = f64_bits(x), magnitude = bits & ~F64_SIGN;
    if (magnitude == 0 || magnitude >= F64_INF)
        return x;
    int16_t biased;
    uint64_t significand = __f64_unpack(magnitude, &biased);
    if (exponent > 4400) /* more than the range of double, and no overflow of int16_t */
        exponent = 4400;
    if (exponent < -4400)
        exponent = -4400;
    return f64_value(__f64_pack(bits & F64_SIGN, (int16_t)(biased + exponent), significand >> 1));
}

double fmin(double x, double y)
{
    return isnan(y) || x < y ? x : y;
}

double fmax(double x, double y)
{
    return isnan(y) || x > y ? x : y;
}

double fmod(double x, double y)
{
    uint64_t sign = f64_bits(x) & F64_SIGN;
    uint64_t left = f64_bits(x) & ~F64_SIGN, right = f64_bits(y) & ~F64_SIGN;
    if (left >= F64_INF || right == 0 || right > F64_INF)
        return f64_value(F64_NAN);
    if (left < right)
        return x;
    int16_t exponent, divisor_exponent;
    uint64_t rest = __f64_unpack(left, &exponent) >> 1, divisor = __f64_unpack(right, &divisor_exponent) >> 1;
    for (;; exponent--) {
        if (rest >= divisor)
            rest -= divisor;
        if (exponent == divisor_exponent)
            break;
        rest <<= 1;
    }
    if (rest == 0)
        return f64_value(sign);
    int16_t shift = (int16_t)(__f64_leading_zeros(rest) - 1);
    return f64_value(__f64_pack(sign, (int16_t)(exponent - shift), rest << shift));
}

/* Square root, correctly rounded; each step computes one bit of the result. */
double sqrt(double x)
{
    uint64_t bits = f64_bits(x);
    if (bits > F64_INF || bits == 0)
        return bits == F64_SIGN || bits == 0 || (bits & ~F64_SIGN) > F64_INF ? x : f64_value(F64_NAN);
    if (bits == F64_INF)
        return x;
    int16_t exponent;
    uint64_t rest = __f64_unpack(bits, &exponent) >> 2; /* below 2^62, so that doubling never overflows */
    exponent = (int16_t)(exponent - F64_BIAS);
    if (exponent & 1)
        exponent--;
    else
        rest >>= 1;
    /* rest / 2^60 is in [1, 4); the loop computes its root times 2^61, highest bit first. */
    uint64_t root = 0;
    for (uint64_t bit = F64_TOP >> 1; bit >= 0x80; bit >>= 1) {
        uint64_t trial = root + (bit >> 1);
        if (rest >= trial) {
            rest -= trial;
            root += bit;
        }
        rest <<= 1;
    }
    if (rest)
        root |= 1;
    return f64_value(__f64_pack(0, (int16_t)(exponent / 2 + F64_BIAS), root << 1));
}
