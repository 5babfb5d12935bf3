/* SPDX-License-Identifier: MIT */
/* strtod, strtold, atof (C11 7.22.1.2, 7.22.1.3): IEC 60559 double. */
#define NUMBER double
#define BITS_T uint64_t
#define WIDTH 64
#define PRECISION 53
#define LOWEST_POWER (-1074) /* exponent of two of the smallest subnormal */
#define EXACT_POWER 22       /* greatest power of ten that a double represents: 10^22 < 2^53 * 2^22 */
#define EXACT_POWERS 5       /* number of entries of POWERS_OF_TEN whose products are 10^0 to 10^22 */
#define EXACT_DIGITS 15
#define GUESSED_DIGITS 18
#define POWERS_OF_TEN 1e1, 1e2, 1e4, 1e8, 1e16, 1e32, 1e64, 1e128, 1e256
#define MOST_DIGITS 770      /* of further digits, only whether one is not 0 affects the result */
#define LARGEST_POWER 310    /* 10^310 overflows with any digits */
#define SMALLEST_POWER (-327)
#define HUGE_NUMBER HUGE_VAL
#define SCALE ldexp
#define STRING_TO_NUMBER strtod
#include "strtod.h"

long double strtold(const char *restrict text, char **restrict end)
{
    return strtod(text, end);
}

double atof(const char *text)
{
    return strtod(text, NULL);
}
