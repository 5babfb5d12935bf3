/* SPDX-License-Identifier: MIT */
/* Packing, shifting and counting for double precision; softfloat.h defines the unpacked form. */
#include "softfloat.h"

int16_t __f64_leading_zeros(uint64_t value)
{
    uint32_t high = (uint32_t)(value >> 32);
    return high ? __f32_leading_zeros(high) : (int16_t)(32 + __f32_leading_zeros((uint32_t)value));
}

uint64_t __f64_shift_sticky(uint64_t significand, int16_t count)
{
    if (count >= 64)
        return significand != 0;
    uint64_t shifted = significand >> count;
    return (shifted << count) == significand ? shifted : shifted | 1;
}

uint64_t __f64_pack(uint64_t sign, int16_t exponent, uint64_t significand)
{
    if (exponent >= 2047)
        return sign | F64_INF;
    if (exponent < 1) {
        significand = __f64_shift_sticky(significand, (int16_t)(1 - exponent));
        exponent = 1;
    }
    uint64_t rounded = (significand + 0x1FF + ((significand >> 10) & 1)) >> 10;
    /* A leading one increments the exponent, as does a carry out of rounding. */
    return sign | (((uint64_t)(uint16_t)(exponent - 1) << 52) + rounded);
}

uint64_t __f64_unpack(uint64_t magnitude, int16_t *exponent)
{
    uint16_t field = (uint16_t)(magnitude >> 52);
    uint64_t significand = magnitude << 11;
    if (field) {
        *exponent = (int16_t)field;
        return significand | F64_SIGN;
    }
    int16_t shift = __f64_leading_zeros(significand);
    *exponent = (int16_t)(1 - shift);
    return significand << shift;
}
