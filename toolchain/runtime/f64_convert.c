/* SPDX-License-Identifier: MIT */
/* Conversions between double precision, single precision and integers. To integer: rounded toward zero,
 * saturated; NaN becomes 0. */
#include "softfloat.h"

int32_t __fixdfsi(double value);
uint32_t __fixunsdfsi(double value);
int64_t __fixdfdi(double value);
uint64_t __fixunsdfdi(double value);
double __floatsidf(int32_t value);
double __floatunsidf(uint32_t value);
double __floatdidf(int64_t value);
double __floatundidf(uint64_t value);
double __extendsfdf2(float value);
float __truncdfsf2(double value);

uint64_t __fixunsdfdi(double value)
{
    uint64_t bits = f64_bits(value);
    if (bits & F64_SIGN || bits > F64_INF)
        return 0;
    int16_t shift = (int16_t)((int16_t)(bits >> 52) - (F64_BIAS + 63));
    if (shift > 0)
        return 0xFFFFFFFFFFFFFFFFULL;
    return shift <= -64 ? 0 : (bits << 11 | F64_SIGN) >> -shift;
}

int64_t __fixdfdi(double value)
{
    uint64_t bits = f64_bits(value);
    uint64_t magnitude = __fixunsdfdi(f64_value(bits & ~F64_SIGN));
    if (bits & F64_SIGN)
        return magnitude > F64_SIGN ? INT64_MIN : (int64_t)(0 - magnitude);
    return magnitude >= F64_SIGN ? INT64_MAX : (int64_t)magnitude;
}

uint32_t __fixunsdfsi(double value)
{
    uint64_t bits = f64_bits(value);
    if (bits & F64_SIGN || bits > F64_INF)
        return 0;
    int16_t shift = (int16_t)((int16_t)(bits >> 52) - (F64_BIAS + 31));
    if (shift > 0)
        return 0xFFFFFFFFUL;
    return shift <= -32 ? 0 : ((uint32_t)(bits >> 21) | F32_SIGN) >> -shift;
}

int32_t __fixdfsi(double value)
{
    uint64_t bits = f64_bits(value);
    uint32_t magnitude = __fixunsdfsi(f64_value(bits & ~F64_SIGN));
    if (bits & F64_SIGN)
        return magnitude > F32_SIGN ? INT32_MIN : (int32_t)(0 - magnitude);
    return magnitude >= F32_SIGN ? INT32_MAX : (int32_t)magnitude;
}

static double from_magnitude(uint64_t sign, uint64_t magnitude)
{
    if (magnitude == 0)
        return 0;
    int16_t shift = (int16_t)(__f64_leading_zeros(magnitude) - 1);
    uint64_t significand = shift < 0 ? (magnitude >> 1) | (magnitude & 1) : magnitude << shift;
    return f64_value(__f64_pack(sign, (int16_t)(F64_BIAS + 62 - shift), significand));
}

double __floatundidf(uint64_t value)
{
    return from_magnitude(0, value);
}

double __floatdidf(int64_t value)
{
    return value < 0 ? from_magnitude(F64_SIGN, 0 - (uint64_t)value) : from_magnitude(0, (uint64_t)value);
}

double __floatunsidf(uint32_t value)
{
    return from_magnitude(0, value);
}

double __floatsidf(int32_t value)
{
    return value < 0 ? from_magnitude(F64_SIGN, 0 - (uint32_t)value) : from_magnitude(0, (uint32_t)value);
}

double __extendsfdf2(float value)
{
    uint32_t bits = f32_bits(value);
    uint64_t sign = (uint64_t)(bits & F32_SIGN) << 32;
    bits &= ~F32_SIGN;
    if (bits >= F32_INF) {
        uint64_t payload = (uint64_t)(bits & F32_MANTISSA) << 29;
        return f64_value(sign | F64_INF | (payload ? payload | F64_QUIET : 0));
    }
    if (bits == 0)
        return f64_value(sign);
    int16_t exponent = (int16_t)(bits >> 23);
    uint64_t mantissa = (uint64_t)(bits & F32_MANTISSA) << 29;
    if (exponent == 0) { /* subnormal singles are normal doubles */
        int16_t shift = (int16_t)(__f32_leading_zeros(bits) - 8);
        mantissa = (uint64_t)((bits << shift) & F32_MANTISSA) << 29;
        exponent = (int16_t)(1 - shift);
    }
    return f64_value(sign | (uint64_t)(uint16_t)(exponent + F64_BIAS - F32_BIAS) << 52 | mantissa);
}

float __truncdfsf2(double value)
{
    uint64_t bits = f64_bits(value);
    uint32_t sign = (uint32_t)(bits >> 32) & F32_SIGN;
    bits &= ~F64_SIGN;
    if (bits > F64_INF)
        return f32_value(sign | F32_NAN);
    int16_t exponent = (int16_t)((int16_t)(bits >> 52) - (F64_BIAS - F32_BIAS));
    if (exponent >= 255)
        return f32_value(sign | F32_INF);
    if (exponent < -30) /* below half of the smallest subnormal, or zero */
        return f32_value(sign);
    uint32_t significand = (uint32_t)(bits >> 22) & (F32_TOP - 1);
    if (bits & 0x3FFFFF)
        significand |= 1;
    return f32_value(__f32_pack(sign, exponent, significand | F32_TOP));
}
