/* SPDX-License-Identifier: MIT */
/* strtof (C11 7.22.1.3): IEC 60559 single, rounded once and without double arithmetic. */
#define NUMBER float
#define BITS_T uint32_t
#define WIDTH 32
#define PRECISION 24
#define LOWEST_POWER (-149) /* of two: the smallest subnormal */
#define EXACT_POWER 10      /* 10^10 < 2^24 * 2^10, so it is a float */
#define EXACT_POWERS 4      /* of POWERS_OF_TEN make all up to it */
#define EXACT_DIGITS 7
#define GUESSED_DIGITS 9
#define POWERS_OF_TEN 1e1f, 1e2f, 1e4f, 1e8f, 1e16f, 1e32f
#define MOST_DIGITS 115     /* more cannot change the result, but that they are not all 0 */
#define LARGEST_POWER 40    /* 10^40 overflows, whatever the digits */
#define SMALLEST_POWER (-46)
#define HUGE_NUMBER HUGE_VALF
#define SCALE ldexpf
#define STRING_TO_NUMBER strtof
#include "strtod.h"
