/* SPDX-License-Identifier: MIT */
/* Single-precision division: two quotient digits of 16 bits (Knuth, TAOCP 2, 4.3.1 algorithm D). */
#include "softfloat.h"

float __divsf3(float left, float right);

/* Return one digit of remainder * 2^16 / divisor and update *remainder; remainder < divisor, bit 31 of divisor is set. */
static uint16_t next_digit(uint32_t *remainder, uint32_t divisor)
{
    uint16_t divisor_high = (uint16_t)(divisor >> 16), divisor_low = (uint16_t)divisor;
    uint16_t digit;
    uint32_t rest;
    if ((uint16_t)(*remainder >> 16) >= divisor_high) {
        digit = 0xFFFF;
        rest = *remainder - ((uint32_t)divisor_high << 16) + divisor_high;
    } else {
        digit = divide_32_16(*remainder, divisor_high);
        rest = *remainder - (uint32_t)digit * divisor_high;
    }
    uint32_t correction = (uint32_t)digit * divisor_low;
    while (rest <= 0xFFFF && correction > rest << 16) {
        digit--;
        rest += divisor_high;
        correction -= divisor_low;
    }
    *remainder = (rest << 16) - correction;
    return digit;
}

float __divsf3(float left, float right)
{
    uint32_t x = f32_bits(left), y = f32_bits(right);
    uint32_t sign = (x ^ y) & F32_SIGN;
    x &= ~F32_SIGN;
    y &= ~F32_SIGN;
    if (x >= F32_INF || y >= F32_INF) {
        if (x > F32_INF || y > F32_INF || x == y)
            return f32_value(F32_NAN);
        return f32_value(x == F32_INF ? sign | F32_INF : sign);
    }
    if (y == 0)
        return f32_value(x == 0 ? F32_NAN : sign | F32_INF);
    if (x == 0)
        return f32_value(sign);
    int16_t x_exponent, y_exponent;
    uint32_t remainder = __f32_unpack(x, &x_exponent) >> 1;
    uint32_t divisor = __f32_unpack(y, &y_exponent);
    uint32_t quotient = (uint32_t)next_digit(&remainder, divisor) << 16;
    quotient |= next_digit(&remainder, divisor);
    if (remainder)
        quotient |= 1;
    int16_t exponent = (int16_t)(x_exponent - y_exponent + F32_BIAS);
    if (quotient & F32_SIGN)
        quotient = (quotient >> 1) | (quotient & 1);
    else
        exponent--;
    return f32_value(__f32_pack(sign, exponent, quotient));
}
