/* SPDX-License-Identifier: MIT */
/* strtof (C11 7.22.1.3): IEC 60559 single, rounded once and without double arithmetic. */
#define NUMBER float
#define BITS_T uint32_t
#define WIDTH 32
#define PRECISION 24
#define LOWEST_POWER (-149) /* exponent of two of the smallest subnormal */
#define EXACT_POWER 10      /* greatest power of ten that a float represents: 10^10 < 2^24 * 2^10 */
#define EXACT_POWERS 4      /* number of entries of POWERS_OF_TEN whose products are 10^0 to 10^10 */
#define EXACT_DIGITS 7
#define GUESSED_DIGITS 9
#define POWERS_OF_TEN 1e1f, 1e2f, 1e4f, 1e8f, 1e16f, 1e32f
#define MOST_DIGITS 115     /* of further digits, only whether one is not 0 affects the result */
#define LARGEST_POWER 40    /* 10^40 overflows with any digits */
#define SMALLEST_POWER (-46)
#define HUGE_NUMBER HUGE_VALF
#define SCALE ldexpf
float __short_atof(const char *text);
#define STRING_TO_NUMBER strtof
#include "strtod.h"

/* atof of programs whose double has 32 bits. */
float __short_atof(const char *text)
{
    return strtof(text, NULL);
}
