/* SPDX-License-Identifier: MIT */
/* Single-precision addition and subtraction. */
#include "softfloat.h"

float __addsf3(float left, float right);
float __subsf3(float left, float right);

static uint32_t add_bits(uint32_t big, uint32_t small)
{
    uint32_t difference = (big ^ small) & F32_SIGN;
    if ((big & ~F32_SIGN) < (small & ~F32_SIGN)) {
        uint32_t swapped = big;
        big = small;
        small = swapped;
    }
    uint32_t sign = big & F32_SIGN;
    big &= ~F32_SIGN;
    small &= ~F32_SIGN;
    if (big >= F32_INF) {
        if (big > F32_INF)
            return big | F32_QUIET;
        return difference && small == F32_INF ? F32_NAN : sign | F32_INF;
    }
    int16_t exponent = (int16_t)(big >> 23);
    int16_t small_exponent = (int16_t)(small >> 23);
    uint32_t sum = (big & F32_MANTISSA) << 7;
    uint32_t addend = (small & F32_MANTISSA) << 7;
    if (exponent)
        sum |= F32_TOP;
    else
        exponent = 1;
    if (small_exponent)
        addend |= F32_TOP;
    else
        small_exponent = 1;
    addend = __f32_shift_sticky(addend, (int16_t)(exponent - small_exponent));
    if (!difference) {
        sum += addend;
        if (sum & F32_SIGN) {
            sum = (sum >> 1) | (sum & 1);
            exponent++;
        }
        return __f32_pack(sign, exponent, sum);
    }
    sum -= addend;
    if (sum == 0)
        return 0; /* x - x is +0 when rounding to nearest (IEC 60559 6.3) */
    int16_t shift = (int16_t)(__f32_leading_zeros(sum) - 1);
    return __f32_pack(sign, (int16_t)(exponent - shift), sum << shift);
}

float __addsf3(float left, float right)
{
    return f32_value(add_bits(f32_bits(left), f32_bits(right)));
}

float __subsf3(float left, float right)
{
    return f32_value(add_bits(f32_bits(left), f32_bits(right) ^ F32_SIGN));
}
