/* SPDX-License-Identifier: MIT */
/* Double-precision division on 16-bit digits, the size of the hardware divider. */
#include "f64_digits.h"

double __divdf3(double left, double right);

/* Return one digit of remainder * 2^16 / divisor (Knuth, TAOCP 2, 4.3.1 algorithm D). `rest` has DIGITS + 1 digits: on
 * entry remainder * 2^16 with remainder < divisor, on return the new remainder in the lower DIGITS digits. */
static uint16_t next_digit(uint16_t *rest, const uint16_t *divisor)
{
    uint16_t top = divisor[DIGITS - 1];
    uint32_t leading = (uint32_t)rest[DIGITS] << 16 | rest[DIGITS - 1];
    uint16_t digit = rest[DIGITS] >= top ? 0xFFFF : divide_32_16(leading, top);
    uint16_t carry = 0, borrow = 0;
    for (uint16_t i = 0; i < DIGITS; i++) {
        uint32_t term = (uint32_t)digit * divisor[i] + carry;
        uint32_t difference = (uint32_t)rest[i] - (uint16_t)term - borrow;
        carry = (uint16_t)(term >> 16);
        rest[i] = (uint16_t)difference;
        borrow = (uint16_t)(difference >> 16) & 1;
    }
    uint32_t difference = (uint32_t)rest[DIGITS] - carry - borrow;
    rest[DIGITS] = (uint16_t)difference;
    while (rest[DIGITS]) { /* the estimate was at most 2 too large: add the divisor until the sum overflows */
        digit--;
        carry = 0;
        for (uint16_t i = 0; i < DIGITS; i++) {
            uint32_t term = (uint32_t)rest[i] + divisor[i] + carry;
            rest[i] = (uint16_t)term;
            carry = (uint16_t)(term >> 16);
        }
        rest[DIGITS] = (uint16_t)(rest[DIGITS] + carry);
    }
    return digit;
}

/* Return dividend * 2^64 / divisor with a sticky lowest bit; dividend < divisor, bit 63 of divisor is set. */
static uint64_t divide_fraction(uint64_t dividend, uint64_t divisor)
{
    uint16_t rest[DIGITS + 1], digits[DIGITS], quotient[DIGITS];
    split(divisor, digits);
    split(dividend, rest + 1);
    for (uint16_t i = DIGITS; i-- > 0;) {
        rest[0] = 0;
        quotient[i] = next_digit(rest, digits);
        for (uint16_t j = DIGITS; j > 0; j--)
            rest[j] = rest[j - 1];
    }
    if (rest[1] | rest[2] | rest[3] | rest[4])
        quotient[0] |= 1;
    return join(quotient);
}

double __divdf3(double left, double right)
{
    uint64_t x = f64_bits(left), y = f64_bits(right);
    uint64_t sign = (x ^ y) & F64_SIGN;
    x &= ~F64_SIGN;
    y &= ~F64_SIGN;
    if (x >= F64_INF || y >= F64_INF) {
        if (x > F64_INF || y > F64_INF || x == y)
            return f64_value(F64_NAN);
        return f64_value(x == F64_INF ? sign | F64_INF : sign);
    }
    if (y == 0)
        return f64_value(x == 0 ? F64_NAN : sign | F64_INF);
    if (x == 0)
        return f64_value(sign);
    int16_t x_exponent, y_exponent;
    uint64_t dividend = __f64_unpack(x, &x_exponent) >> 1;
    uint64_t quotient = divide_fraction(dividend, __f64_unpack(y, &y_exponent));
    int16_t exponent = (int16_t)(x_exponent - y_exponent + F64_BIAS);
    if (quotient & F64_SIGN)
        quotient = (quotient >> 1) | (quotient & 1);
    else
        exponent--;
    return f64_value(__f64_pack(sign, exponent, quotient));
}
