/* SPDX-License-Identifier: MIT */
/* Packing, shifting and counting for single precision; softfloat.h defines the unpacked form. */
#include "softfloat.h"

int16_t __f32_leading_zeros(uint32_t value)
{
    uint16_t word = (uint16_t)(value >> 16);
    int16_t count = 0;
    if (word == 0) {
        word = (uint16_t)value;
        count = 16;
    }
    return (int16_t)(count + __builtin_clz((unsigned)word) - (int16_t)(8 * sizeof(unsigned) - 16));
}

uint32_t __f32_shift_sticky(uint32_t significand, int16_t count)
{
    if (count >= 32)
        return significand != 0;
    uint32_t shifted = significand >> count;
    return (shifted << count) == significand ? shifted : shifted | 1;
}

uint32_t __f32_pack(uint32_t sign, int16_t exponent, uint32_t significand)
{
    if (exponent >= 255)
        return sign | F32_INF;
    if (exponent < 1) {
        significand = __f32_shift_sticky(significand, (int16_t)(1 - exponent));
        exponent = 1;
    }
    uint32_t rounded = (significand + 0x3F + ((significand >> 7) & 1)) >> 7;
    /* A leading one increments the exponent, as does a carry out of rounding. */
    return sign | (((uint32_t)(uint16_t)(exponent - 1) << 23) + rounded);
}

uint32_t __f32_unpack(uint32_t magnitude, int16_t *exponent)
{
    uint16_t field = (uint16_t)(magnitude >> 23);
    uint32_t significand = magnitude << 8;
    if (field) {
        *exponent = (int16_t)field;
        return significand | F32_SIGN;
    }
    int16_t shift = __f32_leading_zeros(significand);
    *exponent = (int16_t)(1 - shift);
    return significand << shift;
}
