/* SPDX-License-Identifier: MIT */
/* Argument reduction for single and double precision; math_reduce.c describes the method. */
#ifndef MATH_REDUCE_H
#define MATH_REDUCE_H

#include "softfloat.h"

/* Digits of the window of 2/pi, by the number of digits of a significand (2 or 4). The fraction has 16 (WINDOW - 1)
 * bits, of which the product's error covers 16 (digits + 1). The argument nearest to a multiple of pi/2 leaves fewer
 * than 32 (single) or 62 (double) leading zeros. */
#define WINDOW(digits) ((digits) == 2 ? 8 : 13)
#define MAX_WINDOW 13
#define REDUCED_NEGATIVE 4

/* Reduce `significand` * 2^*exponent modulo pi/2 to the nearest multiple. `rest` receives `digits` digits of the
 * magnitude of the remainder, a fraction in units of 2^*exponent. Return the multiple modulo 4, with REDUCED_NEGATIVE
 * added if the remainder is negative. */
int __reduce_turns(const uint16_t *two_over_pi, uint64_t significand, int16_t *exponent, uint16_t *rest, int16_t digits);

#endif
