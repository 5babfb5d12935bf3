/* Compares the math sources, compiled for the host with an rt_ prefix, with the host's libm in units of the last place.
 * argv[1]: random arguments per function. Prints the maximum error of each function; exits with 1 above its bound. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FLOAT_NAME(function) rt_##function##f
#define DECLARE1(f) double rt_##f(double); float FLOAT_NAME(f)(float);
#define DECLARE2(f) double rt_##f(double, double); float FLOAT_NAME(f)(float, float);
#define ONE(X) X(sin) X(cos) X(tan) X(asin) X(acos) X(atan) X(exp) X(log) X(log10) X(sqrt) X(floor) X(ceil) X(trunc) X(round) X(fabs) \
    X(sinh) X(cosh) X(tanh) X(asinh) X(acosh) X(atanh) X(exp2) X(expm1) X(log2) X(log1p) X(cbrt) X(rint) X(nearbyint) X(logb)
#define TWO(X) X(atan2) X(pow) X(fmod) X(hypot) X(fmin) X(fmax) X(copysign) X(nextafter) X(remainder) X(fdim)
ONE(DECLARE1)
TWO(DECLARE2)
double rt_frexp(double, int *), rt_ldexp(double, int), rt_modf(double, double *);
double rt_fma(double, double, double), rt_scalbn(double, int), rt_scalbln(double, long), rt_remquo(double, double, int *);
float rt_fmaf(float, float, float), rt_scalblnf(float, long), rt_remquof(float, float, int *), rt_nexttowardf(float, long double);
long rt_lrint(double), rt_lround(double), rt_lrintf(float), rt_lroundf(float);
long long rt_llrint(double), rt_llround(double), rt_llrintf(float), rt_llroundf(float);
int rt_ilogb(double), rt_ilogbf(float);
float rt_frexpf(float, int *), rt_ldexpf(float, int), rt_modff(float, float *);

static uint64_t state = 0x9E3779B97F4A7C15u; /* xorshift64*, fixed seed */
static uint64_t random64(void)
{
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return state * 0x2545F4914F6CDD1Du;
}
static double as_double(uint64_t bits) { double d; memcpy(&d, &bits, 8); return d; }

static int failed;
static double worst, worst_x, worst_y;
static void measure(double x, double y, double got, double want, int mantissa, int lowest)
{
    if (isnan(want) || isinf(want) || want == 0) {
        int same = isnan(want) ? isnan(got) : got == want && (want != 0 || signbit(got) == signbit(want));
        if (same)
            return;
        worst = HUGE_VAL; /* NaN, infinity and the sign of zero must be exact */
        worst_x = x;
        worst_y = y;
        return;
    }
    int exponent;
    frexp(want, &exponent);
    double unit = ldexp(1, (exponent < lowest ? lowest : exponent) - mantissa);
    double error = fabs(got - want) / unit;
    if (!(error <= worst)) {
        worst = error;
        worst_x = x;
        worst_y = y;
    }
}
static void report(const char *name, double bound)
{
    printf("%s %.3f ulp at (%.17g, %.17g)%s\n", name, worst, worst_x, worst_y, worst <= bound ? "" : " TOO LARGE");
    failed |= !(worst <= bound);
    worst = 0;
}

/* Returns a random number with an exponent from 2^low to 2^high, or a special value. */
static double sample(long i, int low, int high)
{
    static const double special[] = {0.0, -0.0, 1, -1, 0.5, -0.5, 2, -2, 1.5, 2.5, 3, -3, 4, 10, INFINITY, -INFINITY, NAN};
    uint64_t r = random64();
    if (i % 64 == 0)
        return special[r % (sizeof special / sizeof special[0])];
    return as_double((r & 0x800FFFFFFFFFFFFF) | (uint64_t)(1023 + low + (int)(random64() % (uint64_t)(high - low))) << 52);
}

#define CHECK1(f, low, high, bound, boundf)                                                                         \
    for (long i = 0; i < n; i++) {                                                                                  \
        double x = sample(i, low, high);                                                                            \
        measure(x, 0, rt_##f(x), f(x), 53, -1021);                                                                  \
    }                                                                                                               \
    report(#f, bound);                                                                                              \
    for (long i = 0; i < n; i++) {                                                                                  \
        float x = (float)sample(i, low < -140 ? -140 : low, high > 12 ? 12 : high);                                 \
        measure(x, 0, FLOAT_NAME(f)(x), (float)f((double)x), 24, -125);                                                 \
    }                                                                                                               \
    report(#f "f", boundf);
#define CHECK2(f, low, high, bound, boundf)                                                                         \
    for (long i = 0; i < n; i++) {                                                                                  \
        double x = sample(i, low, high), y = sample(i * 7 + 1, low, high);                                          \
        measure(x, y, rt_##f(x, y), f(x, y), 53, -1021);                                                            \
    }                                                                                                               \
    report(#f, bound);                                                                                              \
    for (long i = 0; i < n; i++) {                                                                                  \
        float x = (float)sample(i, low, high), y = (float)sample(i * 7 + 1, low, high);                             \
        measure(x, y, FLOAT_NAME(f)(x, y), (float)f((double)x, (double)y), 24, -125);                                   \
    }                                                                                                               \
    report(#f "f", boundf);

/* Checks functions with several results or three arguments, which must equal the host's exactly. */
static void check_exact(long n)
{
    for (long i = 0; i < n; i++) {
        double x = sample(i, -10, 40), y = sample(i * 3 + 1, -10, 20), z = sample(i * 5 + 2, -60, 60);
        int got, want;
        measure(x, y, rt_remquo(x, y, &got), remquo(x, y, &want), 53, -1021);
        if (isfinite(x) && !isnan(y) && y != 0)
            failed |= (got & 7) != (want & 7);
        measure(x, y, rt_fma(x, y, z), fma(x, y, z), 53, -1021);
        double near = fma(-x, y, sample(i, -1, 1)); /* cancels most of the product */
        measure(x, y, rt_fma(x, y, near), fma(x, y, near), 53, -1021);
        double tiny = sample(i * 11, -1022, -400), small = sample(i * 13, -620, -400);
        measure(tiny, small, rt_fma(tiny, small, small), fma(tiny, small, small), 53, -1021);
        measure(tiny, small, rt_fma(small, small, tiny), fma(small, small, tiny), 53, -1021);
        float a = (float)x, b = (float)y, c = (float)z;
        measure(a, b, rt_fmaf(a, b, c), fmaf(a, b, c), 24, -125);
        measure(a, b, rt_remquof(a, b, &got), remquof(a, b, &want), 24, -125);
        measure(a, b, rt_nexttowardf(a, (long double)y), nexttowardf(a, (long double)y), 24, -125);
        measure(a, b, rt_nexttowardf(a, (long double)-y), nexttowardf(a, (long double)-y), 24, -125);
        measure(x, 0, rt_scalbn(x, (int)(i % 2200) - 1100), scalbn(x, (int)(i % 2200) - 1100), 53, -1021);
        measure(x, 0, rt_scalbln(x, i * 1000003), scalbln(x, i * 1000003), 53, -1021);
        measure(a, 0, rt_scalblnf(a, -i), scalblnf(a, -i), 24, -125);
        if (fabs(x) < 1e9)
            failed |= rt_lrint(x) != lrint(x) || rt_lround(x) != lround(x) || rt_lrintf(a) != lrintf(a) ||
                      rt_lroundf(a) != lroundf(a) || rt_llrint(x) != llrint(x) || rt_llround(x) != llround(x) ||
                      rt_llrintf(a) != llrintf(a) || rt_llroundf(a) != llroundf(a);
    }
    report("remquo fma nexttoward scalbn lrint lround", 0);
}

/* The host's cbrt has a larger error than the bound: its long double version is the reference. */
#define cbrt(x) (double)cbrtl(x)

int main(int argc, char **argv)
{
    long n = argc > 1 ? atol(argv[1]) : 1000000;
    CHECK1(sqrt, -1022, 1023, 0, 0)
    CHECK1(floor, -60, 60, 0, 0)
    CHECK1(ceil, -60, 60, 0, 0)
    CHECK1(trunc, -60, 60, 0, 0)
    CHECK1(round, -60, 60, 0, 0)
    CHECK1(fabs, -1022, 1023, 0, 0)
    CHECK1(sin, -30, 16, 2, 2)
    CHECK1(cos, -30, 16, 2, 2)
    CHECK1(tan, -30, 16, 3, 4)
    CHECK1(atan, -60, 60, 2, 3)
    CHECK1(asin, -30, 0, 3, 4)
    CHECK1(acos, -30, 0, 3, 4)
    CHECK1(exp, -60, 10, 2, 2)
    CHECK1(log, -1022, 1023, 2, 2)
    CHECK1(log10, -1022, 1023, 3, 3)
    CHECK2(atan2, -60, 60, 3, 3)
    CHECK2(pow, -4, 7, 3, 1)
    CHECK2(fmod, -20, 20, 0, 0)
    CHECK2(hypot, -60, 60, 3, 3)
    CHECK2(fmin, -60, 60, 0, 0)
    CHECK2(fmax, -60, 60, 0, 0)
    CHECK2(copysign, -60, 60, 0, 0)
    CHECK1(sinh, -60, 11, 4, 1)
    CHECK1(cosh, -60, 11, 4, 1)
    CHECK1(tanh, -60, 8, 4, 1)
    CHECK1(asinh, -60, 200, 4, 1)
    CHECK1(acosh, -1, 200, 4, 1)
    CHECK1(atanh, -60, 1, 4, 1)
    CHECK1(exp2, -60, 12, 2, 1)
    CHECK1(expm1, -60, 10, 3, 1)
    CHECK1(log2, -1022, 1023, 3, 1)
    CHECK1(log1p, -60, 200, 4, 1)
    CHECK1(cbrt, -1022, 1023, 1, 1)
    CHECK1(rint, -60, 60, 0, 0)
    CHECK1(nearbyint, -60, 60, 0, 0)
    CHECK1(logb, -1022, 1023, 0, 0)
    CHECK2(nextafter, -3, 3, 0, HUGE_VAL) /* nextafter of doubles differs from that of floats */
    CHECK2(remainder, -20, 20, 0, 0)
    CHECK2(fdim, -60, 60, 0, 0)
    check_exact(n);
    for (long i = 0; i < n; i++) {
        int exponent = (int)(random64() % 4400) - 2200, got, want;
        double x = sample(i, -1022, 1023), whole, rt_whole;
        measure(x, exponent, rt_ldexp(x, exponent), ldexp(x, exponent), 53, -1021);
        measure(x, 0, rt_frexp(x, &got), frexp(x, &want), 53, -1021);
        failed |= isfinite(x) && got != want;
        failed |= isfinite(x) && x != 0 && rt_ilogb(x) != ilogb(x);
        measure(x, 1, rt_modf(x, &rt_whole), modf(x, &whole), 53, -1021);
        measure(x, 2, rt_whole, whole, 53, -1021);
        float y = (float)sample(i, -140, 127), wholef, rt_wholef;
        measure(y, exponent, rt_ldexpf(y, exponent / 8), ldexpf(y, exponent / 8), 24, -125);
        measure(y, 0, rt_frexpf(y, &got), frexpf(y, &want), 24, -125);
        failed |= isfinite(y) && got != want;
        failed |= isfinite(y) && y != 0 && rt_ilogbf(y) != ilogbf(y);
        measure(y, 1, rt_modff(y, &rt_wholef), modff(y, &wholef), 24, -125);
        measure(y, 2, rt_wholef, wholef, 24, -125);
    }
    report("ldexp frexp modf", 0);
    return failed;
}
