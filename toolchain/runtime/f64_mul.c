/* SPDX-License-Identifier: MIT */
/* Double-precision multiplication on 16-bit digits, the size of the hardware multiplier. */
#include "f64_digits.h"

double __muldf3(double left, double right);

/* Return the upper 64 bits of the 128-bit product; the lowest bit is sticky. */
static uint64_t multiply_high(uint64_t left, uint64_t right)
{
    uint16_t x[DIGITS], y[DIGITS], sum[2 * DIGITS] = {0};
    split(left, x);
    split(right, y);
    for (uint16_t i = 0; i < DIGITS; i++) {
        uint16_t carry = 0;
        for (uint16_t j = 0; j < DIGITS; j++) {
            uint32_t term = (uint32_t)x[i] * y[j] + sum[i + j] + carry;
            sum[i + j] = (uint16_t)term;
            carry = (uint16_t)(term >> 16);
        }
        sum[i + DIGITS] = carry;
    }
    if (sum[0] | sum[1] | sum[2] | sum[3])
        sum[4] |= 1;
    return join(sum + DIGITS);
}

double __muldf3(double left, double right)
{
    uint64_t x = f64_bits(left), y = f64_bits(right);
    uint64_t sign = (x ^ y) & F64_SIGN;
    x &= ~F64_SIGN;
    y &= ~F64_SIGN;
    if (x >= F64_INF || y >= F64_INF) {
        if (x > F64_INF || y > F64_INF || x == 0 || y == 0)
            return f64_value(F64_NAN);
        return f64_value(sign | F64_INF);
    }
    if (x == 0 || y == 0)
        return f64_value(sign);
    int16_t x_exponent, y_exponent;
    uint64_t x_significand = __f64_unpack(x, &x_exponent);
    uint64_t result = multiply_high(x_significand, __f64_unpack(y, &y_exponent));
    int16_t exponent = (int16_t)(x_exponent + y_exponent - F64_BIAS);
    if (result & F64_SIGN) {
        result = (result >> 1) | (result & 1);
        exponent++;
    }
    return f64_value(__f64_pack(sign, exponent, result));
}
