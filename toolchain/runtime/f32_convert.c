/* SPDX-License-Identifier: MIT */
/* Conversions between single precision and integers. To integer: rounded toward zero, saturated; NaN becomes 0. */
#include "softfloat.h"

int32_t __fixsfsi(float value);
uint32_t __fixunssfsi(float value);
int64_t __fixsfdi(float value);
uint64_t __fixunssfdi(float value);
float __floatsisf(int32_t value);
float __floatunsisf(uint32_t value);
float __floatdisf(int64_t value);
float __floatundisf(uint64_t value);

uint32_t __fixunssfsi(float value)
{
    uint32_t bits = f32_bits(value);
    if (bits & F32_SIGN || bits > F32_INF)
        return 0;
    int16_t shift = (int16_t)((int16_t)(bits >> 23) - (F32_BIAS + 31));
    if (shift > 0)
        return 0xFFFFFFFFUL;
    return shift <= -32 ? 0 : (bits << 8 | F32_SIGN) >> -shift;
}

int32_t __fixsfsi(float value)
{
    uint32_t bits = f32_bits(value);
    uint32_t magnitude = __fixunssfsi(f32_value(bits & ~F32_SIGN));
    if (bits & F32_SIGN)
        return magnitude > F32_SIGN ? INT32_MIN : (int32_t)(0 - magnitude);
    return magnitude >= F32_SIGN ? INT32_MAX : (int32_t)magnitude;
}

uint64_t __fixunssfdi(float value)
{
    uint32_t bits = f32_bits(value);
    if (bits & F32_SIGN || bits > F32_INF)
        return 0;
    int16_t shift = (int16_t)((int16_t)(bits >> 23) - (F32_BIAS + 31));
    if (shift > 32)
        return 0xFFFFFFFFFFFFFFFFULL;
    uint32_t significand = bits << 8 | F32_SIGN;
    if (shift >= 0)
        return (uint64_t)significand << shift;
    return shift <= -32 ? 0 : significand >> -shift;
}

int64_t __fixsfdi(float value)
{
    uint32_t bits = f32_bits(value);
    uint64_t magnitude = __fixunssfdi(f32_value(bits & ~F32_SIGN));
    if (bits & F32_SIGN)
        return magnitude > F64_SIGN ? INT64_MIN : (int64_t)(0 - magnitude);
    return magnitude >= F64_SIGN ? INT64_MAX : (int64_t)magnitude;
}

static float from_magnitude(uint32_t sign, uint32_t magnitude)
{
    if (magnitude == 0)
        return 0;
    int16_t shift = (int16_t)(__f32_leading_zeros(magnitude) - 1);
    uint32_t significand = shift < 0 ? (magnitude >> 1) | (magnitude & 1) : magnitude << shift;
    return f32_value(__f32_pack(sign, (int16_t)(F32_BIAS + 30 - shift), significand));
}

float __floatunsisf(uint32_t value)
{
    return from_magnitude(0, value);
}

float __floatsisf(int32_t value)
{
    return value < 0 ? from_magnitude(F32_SIGN, 0 - (uint32_t)value) : from_magnitude(0, (uint32_t)value);
}

static float from_wide_magnitude(uint32_t sign, uint64_t magnitude)
{
    uint32_t high = (uint32_t)(magnitude >> 32);
    if (high == 0)
        return from_magnitude(sign, (uint32_t)magnitude);
    int16_t shift = (int16_t)(33 - __f32_leading_zeros(high)); /* moves the leading one to bit 30 */
    uint64_t kept = magnitude >> shift;
    uint32_t significand = (uint32_t)kept;
    if (kept << shift != magnitude)
        significand |= 1;
    return f32_value(__f32_pack(sign, (int16_t)(F32_BIAS + 30 + shift), significand));
}

float __floatundisf(uint64_t value)
{
    return from_wide_magnitude(0, value);
}

float __floatdisf(int64_t value)
{
    return value < 0 ? from_wide_magnitude(F32_SIGN, 0 - (uint64_t)value) : from_wide_magnitude(0, (uint64_t)value);
}
