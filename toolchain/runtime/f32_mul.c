/* SPDX-License-Identifier: MIT */
/* Single-precision multiplication. */
#include "softfloat.h"

float __mulsf3(float left, float right);

static uint32_t product(uint16_t left, uint16_t right)
{
    return (uint32_t)left * right;
}

/* Return the upper 32 bits of the 64-bit product; the lowest bit is sticky. */
static uint32_t multiply_high(uint32_t left, uint32_t right)
{
    uint16_t left_high = (uint16_t)(left >> 16), left_low = (uint16_t)left;
    uint16_t right_high = (uint16_t)(right >> 16), right_low = (uint16_t)right;
    uint32_t low = product(left_low, right_low);
    uint32_t middle = product(left_high, right_low) + (low >> 16);
    uint32_t other = product(left_low, right_high) + (uint16_t)middle;
    uint32_t high = product(left_high, right_high) + (middle >> 16) + (other >> 16);
    return (uint16_t)other | (uint16_t)low ? high | 1 : high;
}

float __mulsf3(float left, float right)
{
    uint32_t x = f32_bits(left), y = f32_bits(right);
    uint32_t sign = (x ^ y) & F32_SIGN;
    x &= ~F32_SIGN;
    y &= ~F32_SIGN;
    if (x >= F32_INF || y >= F32_INF) {
        if (x > F32_INF || y > F32_INF || x == 0 || y == 0)
            return f32_value(F32_NAN);
        return f32_value(sign | F32_INF);
    }
    if (x == 0 || y == 0)
        return f32_value(sign);
    int16_t x_exponent, y_exponent;
    uint32_t x_significand = __f32_unpack(x, &x_exponent);
    uint32_t result = multiply_high(x_significand, __f32_unpack(y, &y_exponent));
    int16_t exponent = (int16_t)(x_exponent + y_exponent - F32_BIAS);
    if (result & F32_SIGN) {
        result = (result >> 1) | (result & 1);
        exponent++;
    }
    return f32_value(__f32_pack(sign, exponent, result));
}
