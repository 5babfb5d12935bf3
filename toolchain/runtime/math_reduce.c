/* SPDX-License-Identifier: MIT */
/* Argument reduction of trigonometric functions after Payne and Hanek: exact for every exponent. The argument is a whole
 * number m times 2^e. Digits of 2/pi above 2^(2-e) change x * 2/pi by a multiple of 4 only, so that a window of digits
 * below that place gives quadrant and fraction. Numbers are arrays of 16-bit digits, least significant first. */
#include "math_reduce.h"

static void multiply(uint16_t *product, const uint16_t *x, int16_t x_digits, const uint16_t *y, int16_t y_digits)
{
    for (int16_t j = 0; j < y_digits; j++)
        product[j] = 0;
    for (int16_t i = 0; i < x_digits; i++) {
        uint16_t factor = x[i], carry = 0;
        uint16_t *sum = product + i;
        for (int16_t j = 0; j < y_digits; j++) {
            uint32_t term = (uint32_t)factor * y[j] + *sum + carry;
            *sum++ = (uint16_t)term;
            carry = (uint16_t)(term >> 16);
        }
        *sum = carry;
    }
}

int __reduce_turns(const uint16_t *two_over_pi, uint64_t significand, int16_t *exponent, uint16_t *rest, int16_t digits)
{
    static const uint16_t half_pi[] = {0xC235, 0x2168, 0xDAA2, 0xC90F}; /* times 2^-63 */
    uint16_t factor[5], window[MAX_WINDOW], product[MAX_WINDOW + 5];
    /* x = significand * 2^*exponent = factor * 2^(16 place) */
    int16_t place = *exponent >> 4, shift = *exponent & 15, size = (int16_t)(digits + 1);
    for (int16_t i = 0; i < digits; i++) {
        factor[i] = (uint16_t)significand;
        significand >>= 16;
    }
    uint16_t low = 0;
    for (int16_t i = 0; i < digits; i++) {
        uint32_t shifted = (uint32_t)factor[i] << shift;
        factor[i] = (uint16_t)shifted | low;
        low = (uint16_t)(shifted >> 16);
    }
    factor[digits] = low;
    /* digit i of 2/pi has the weight 2^(-16 (i+1)); times 2^(16 place), digit `place - 1` counts ones */
    int16_t count = (int16_t)WINDOW(digits);
    for (int16_t i = 0; i < count; i++) {
        int16_t from = (int16_t)(place - 1 + i);
        window[count - 1 - i] = from < 0 ? 0 : two_over_pi[from];
    }
    multiply(product, factor, size, window, count);
    uint16_t quadrant = product[count - 1];
    uint16_t negative = product[count - 2] >> 15;
    if (negative) { /* the nearest multiple is the next one: the fraction becomes its negative distance */
        quadrant++;
        for (int16_t i = 0; i < count - 1; i++)
            product[i] = (uint16_t)~product[i]; /* the error of one in the last digit is below the precision */
    }
    int16_t top = (int16_t)(count - 2);
    while (top > digits && product[top] == 0)
        top--;
    int16_t zeros = (int16_t)(__builtin_clz((unsigned)product[top] | 1) - (int16_t)(8 * sizeof(unsigned) - 16));
    for (int16_t i = 0; i < digits; i++) {
        uint16_t *at = product + top - digits + i;
        factor[i] = (uint16_t)((((uint32_t)at[1] << 16 | at[0]) << zeros) >> 16);
    }
    multiply(window, factor, digits, half_pi + 4 - digits, digits);
    for (int16_t i = 0; i < digits; i++)
        rest[i] = window[digits + i];
    /* the fraction is 0.FACTOR * 2^-(zeros + 16 (count - 2 - top)), half_pi is 0.HALF_PI * 2 */
    *exponent = (int16_t)(1 - zeros - 16 * (count - 2 - top));
    return (int)(quadrant & 3) | (negative ? REDUCED_NEGATIVE : 0);
}
