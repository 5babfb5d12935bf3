/* SPDX-License-Identifier: MIT */
/* Double-precision addition and subtraction. */
#include "softfloat.h"

double __adddf3(double left, double right);
double __subdf3(double left, double right);

static uint64_t add_bits(uint64_t big, uint64_t small)
{
    uint64_t difference = (big ^ small) & F64_SIGN;
    if ((big & ~F64_SIGN) < (small & ~F64_SIGN)) {
        uint64_t swapped = big;
        big = small;
        small = swapped;
    }
    uint64_t sign = big & F64_SIGN;
    big &= ~F64_SIGN;
    small &= ~F64_SIGN;
    if (big >= F64_INF) {
        if (big > F64_INF)
            return big | F64_QUIET;
        return difference && small == F64_INF ? F64_NAN : sign | F64_INF;
    }
    int16_t exponent = (int16_t)(big >> 52);
    int16_t small_exponent = (int16_t)(small >> 52);
    uint64_t sum = (big & F64_MANTISSA) << 10;
    uint64_t addend = (small & F64_MANTISSA) << 10;
    if (exponent)
        sum |= F64_TOP;
    else
        exponent = 1;
    if (small_exponent)
        addend |= F64_TOP;
    else
        small_exponent = 1;
    addend = __f64_shift_sticky(addend, (int16_t)(exponent - small_exponent));
    if (!difference) {
        sum += addend;
        if (sum & F64_SIGN) {
            sum = (sum >> 1) | (sum & 1);
            exponent++;
        }
        return __f64_pack(sign, exponent, sum);
    }
    sum -= addend;
    if (sum == 0)
        return 0; /* x - x is +0 when rounding to nearest (IEC 60559 6.3) */
    int16_t shift = (int16_t)(__f64_leading_zeros(sum) - 1);
    return __f64_pack(sign, (int16_t)(exponent - shift), sum << shift);
}

double __adddf3(double left, double right)
{
    return f64_value(add_bits(f64_bits(left), f64_bits(right)));
}

double __subdf3(double left, double right)
{
    return f64_value(add_bits(f64_bits(left), f64_bits(right) ^ F64_SIGN));
}
