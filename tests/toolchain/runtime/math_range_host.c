/* Compares the math sources, compiled for the host with an rt_ prefix, with the host's long double functions over all
 * exponents and signs, subnormal numbers, infinities and NaN. argv[1]: random significands per exponent. Prints one line
 * per function: name, largest error in units of the last place, its arguments; exits with 1 if a special value differs. */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ONE(X) X(sin) X(cos) X(tan) X(asin) X(acos) X(atan) X(exp) X(exp2) X(expm1) X(log) X(log2) X(log10) X(log1p) \
    X(sinh) X(cosh) X(tanh) X(asinh) X(acosh) X(atanh) X(sqrt) X(cbrt) X(floor) X(ceil) X(trunc) X(round) X(rint) \
    X(nearbyint) X(fabs) X(logb)
#define TWO(X) X(atan2) X(pow) X(hypot) X(fmod) X(remainder) X(fdim) X(copysign)
#define DECLARE1(F) double rt_##F(double); float rt_##F##f(float);
#define DECLARE2(F) double rt_##F(double, double); float rt_##F##f(float, float);
ONE(DECLARE1)
TWO(DECLARE2)

static uint64_t state = 0x9E3779B97F4A7C15u; /* xorshift64*, fixed seed */
static uint64_t random64(void)
{
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return state * 0x2545F4914F6CDD1Du;
}

static long per_exponent;
static int failed;
static long double worst;
static double worst_x, worst_y;

/* Add the error of `got` in units of the last place of the exact result `want`. */
static void measure(double x, double y, double got, long double want, int mantissa, int lowest)
{
    long double largest = mantissa == 53 ? (long double)DBL_MAX : (long double)FLT_MAX, error;
    if (isnan(want))
        error = isnan(got) ? 0 : HUGE_VALL;
    else if (isinf(got))
        error = want * (got > 0 ? 1 : -1) > largest * (1 - ldexpl(1, -20)) ? 0 : HUGE_VALL;
    else if (isinf(want))
        error = HUGE_VALL;
    else if (want == 0)
        error = got == 0 && !signbit(got) == !signbit(want) ? 0 : HUGE_VALL;
    else {
        int exponent;
        frexpl(want, &exponent);
        error = fabsl(got - want) / ldexpl(1, (exponent < lowest ? lowest : exponent) - mantissa);
    }
    if (!(error <= worst)) {
        worst = error;
        worst_x = x;
        worst_y = y;
    }
}

static void report(const char *name)
{
    printf("%s %.3f (%.17g, %.17g)\n", name, (double)worst, worst_x, worst_y);
    failed |= isinf(worst);
    worst = 0;
}

static const double special[] = {0.0, -0.0, 1, -1, 0.5, -0.5, 2, -2, 1.5, 2.5, 3, -3, 4, 10, 88.8, -104, 709.8, -745.2,
                                 3.14159265358979, 1.5707963267948966, INFINITY, -INFINITY, NAN, 4503599627370497.5,
                                 6381956970095103.0 * 0x1p797 /* nearest to a multiple of pi/2 */, DBL_MAX, FLT_MAX,
                                 DBL_MIN, FLT_MIN, 5e-324, 1.4e-45};
#define SPECIALS (long)(sizeof special / sizeof *special)

/* Argument number i of doubles or floats: special values, then all exponents with both signs and several significands. */
static double argument(long i, int is_float)
{
    long exponents = is_float ? 256 : 2048;
    if (i < SPECIALS)
        return is_float ? (float)special[i] : special[i];
    i -= SPECIALS;
    uint64_t significand = i / (2 * exponents) == 0 ? 0 : i / (2 * exponents) == 1 ? ~0ull : random64();
    uint64_t exponent = (uint64_t)(i / 2 % exponents), sign = (uint64_t)(i % 2);
    if (is_float) {
        uint32_t bits = (uint32_t)(sign << 31 | exponent << 23 | significand >> 41);
        float value;
        memcpy(&value, &bits, 4);
        return value;
    }
    uint64_t bits = sign << 63 | exponent << 52 | significand >> 12;
    double value;
    memcpy(&value, &bits, 8);
    return value;
}
static long arguments(int is_float)
{
    return SPECIALS + 2 * (is_float ? 256 : 2048) * (per_exponent + 2);
}

#define CHECK1(F)                                                                \
    for (long i = 0; i < arguments(0); i++) {                                    \
        double x = argument(i, 0);                                               \
        measure(x, 0, rt_##F(x), F##l(x), 53, -1021);                            \
    }                                                                            \
    report(#F);                                                                  \
    for (long i = 0; i < arguments(1); i++) {                                    \
        float x = (float)argument(i, 1);                                         \
        measure(x, 0, rt_##F##f(x), F##l(x), 24, -125);                          \
    }                                                                            \
    report(#F "f");

/* All pairs of special values, then pairs of random exponents, half of them close to each other. */
#define PAIR(i, is_float, x, y)                                                                            \
    x = i < SPECIALS * SPECIALS ? argument(i / SPECIALS, is_float) : argument(random_place(is_float), is_float); \
    y = i < SPECIALS * SPECIALS ? argument(i % SPECIALS, is_float) : argument(random_place(is_float), is_float); \
    if (i >= SPECIALS * SPECIALS && i % 2 && isfinite(x) && isfinite(y) && x != 0 && y != 0)               \
        y = ldexp(y, ilogb(x) - ilogb(y) + (int)(random64() % 64) - 32);
static long random_place(int is_float)
{
    return (long)(random64() % (uint64_t)arguments(is_float));
}
#define CHECK2(F)                                                                \
    for (long i = 0; i < 2 * arguments(0); i++) {                                \
        double x, y;                                                             \
        PAIR(i, 0, x, y)                                                         \
        measure(x, y, rt_##F(x, y), F##l(x, y), 53, -1021);                      \
    }                                                                            \
    report(#F);                                                                  \
    for (long i = 0; i < 8 * arguments(1); i++) {                                \
        float x, y;                                                              \
        PAIR(i, 1, x, y)                                                         \
        measure(x, y, rt_##F##f(x, y), F##l(x, y), 24, -125);                    \
    }                                                                            \
    report(#F "f");

int main(int argc, char **argv)
{
    per_exponent = argc > 1 ? atol(argv[1]) : 16;
    ONE(CHECK1)
    TWO(CHECK2)
    return failed;
}
