/* SPDX-License-Identifier: MIT */
/* C11 7.12 without erf, erfc, lgamma and tgamma; double is 64-bit IEEE, float 32-bit. There is no errno reporting. */
#ifndef MATH_H
#define MATH_H

#ifdef __cplusplus
extern "C" {
#endif

#define HUGE_VAL __builtin_huge_val()
#define HUGE_VALF __builtin_huge_valf()
#define INFINITY __builtin_inff()
#define NAN __builtin_nanf("")
#define FP_ILOGB0 (-__INT_MAX__ - 1)
#define FP_ILOGBNAN __INT_MAX__
#define M_E 2.7182818284590452354
#define M_LN2 0.69314718055994530942
#define M_PI 3.14159265358979323846
#define M_PI_2 1.57079632679489661923
#define M_PI_4 0.78539816339744830962
#define M_SQRT2 1.41421356237309504880

#define FP_NAN 0
#define FP_INFINITE 1
#define FP_ZERO 2
#define FP_SUBNORMAL 3
#define FP_NORMAL 4
#define fpclassify(x) __builtin_fpclassify(FP_NAN, FP_INFINITE, FP_NORMAL, FP_SUBNORMAL, FP_ZERO, x)
#define isnormal(x) __builtin_isnormal(x)
#define isgreater(x, y) __builtin_isgreater(x, y)
#define isgreaterequal(x, y) __builtin_isgreaterequal(x, y)
#define isless(x, y) __builtin_isless(x, y)
#define islessequal(x, y) __builtin_islessequal(x, y)
#define islessgreater(x, y) __builtin_islessgreater(x, y)
#define isunordered(x, y) __builtin_isunordered(x, y)
#define isnan(x) __builtin_isnan(x)
#define isinf(x) __builtin_isinf(x)
#define isfinite(x) __builtin_isfinite(x)
#define signbit(x) __builtin_signbit(x)

typedef float float_t;
typedef double double_t;

double fabs(double x);
double floor(double x);
double ceil(double x);
double trunc(double x);
double round(double x);
double fmod(double x, double y);
double modf(double x, double *whole);
double frexp(double x, int *exponent);
double ldexp(double x, int exponent);
int ilogb(double x);
int ilogbl(long double x);
double copysign(double magnitude, double sign);
double fmin(double x, double y);
double fmax(double x, double y);
double sqrt(double x);
double sin(double x);
double cos(double x);
double tan(double x);
double asin(double x);
double acos(double x);
double atan(double x);
double atan2(double y, double x);
double exp(double x);
double log(double x);
double log10(double x);
double pow(double x, double y);
double hypot(double x, double y);
double sinh(double x);
double cosh(double x);
double tanh(double x);
double asinh(double x);
double acosh(double x);
double atanh(double x);
double exp2(double x);
double expm1(double x);
double log2(double x);
double log1p(double x);
double cbrt(double x);
double rint(double x);
double nearbyint(double x);
long lrint(double x);
long long llrint(double x);
long lround(double x);
long long llround(double x);
double logb(double x);
double scalbn(double x, int exponent);
double scalbln(double x, long exponent);
double nextafter(double x, double towards);
double nexttoward(double x, long double towards);
double remainder(double x, double y);
double remquo(double x, double y, int *quotient); /* the quotient's three lowest bits and its sign */
double fdim(double x, double y);
double fma(double x, double y, double z);
double nan(const char *payload);

float fabsf(float x);
float floorf(float x);
float ceilf(float x);
float truncf(float x);
float roundf(float x);
float fmodf(float x, float y);
float modff(float x, float *whole);
float frexpf(float x, int *exponent);
float ldexpf(float x, int exponent);
int ilogbf(float x);
float copysignf(float magnitude, float sign);
float fminf(float x, float y);
float fmaxf(float x, float y);
float sqrtf(float x);
float sinf(float x);
float cosf(float x);
float tanf(float x);
float asinf(float x);
float acosf(float x);
float atanf(float x);
float atan2f(float y, float x);
float expf(float x);
float logf(float x);
float log10f(float x);
float powf(float x, float y);
float hypotf(float x, float y);
float sinhf(float x);
float coshf(float x);
float tanhf(float x);
float asinhf(float x);
float acoshf(float x);
float atanhf(float x);
float exp2f(float x);
float expm1f(float x);
float log2f(float x);
float log1pf(float x);
float cbrtf(float x);
float rintf(float x);
float nearbyintf(float x);
long lrintf(float x);
long long llrintf(float x);
long lroundf(float x);
long long llroundf(float x);
float logbf(float x);
float scalbnf(float x, int exponent);
float scalblnf(float x, long exponent);
float nextafterf(float x, float towards);
float nexttowardf(float x, long double towards);
float remainderf(float x, float y);
float remquof(float x, float y, int *quotient); /* the quotient's three lowest bits and its sign */
float fdimf(float x, float y);
float fmaf(float x, float y, float z);
float nanf(const char *payload);

/* long double is double (abi-elf.md §1.1), with the same functions. */
#define MATH_LONG(result, name, ...) result name##l(__VA_ARGS__) __asm__(#name)
MATH_LONG(long double, acos, long double x);
MATH_LONG(long double, asin, long double x);
MATH_LONG(long double, atan, long double x);
MATH_LONG(long double, ceil, long double x);
MATH_LONG(long double, cos, long double x);
MATH_LONG(long double, cosh, long double x);
MATH_LONG(long double, sinh, long double x);
MATH_LONG(long double, tanh, long double x);
MATH_LONG(long double, acosh, long double x);
MATH_LONG(long double, asinh, long double x);
MATH_LONG(long double, atanh, long double x);
MATH_LONG(long double, exp, long double x);
MATH_LONG(long double, exp2, long double x);
MATH_LONG(long double, expm1, long double x);
MATH_LONG(long double, fabs, long double x);
MATH_LONG(long double, floor, long double x);
MATH_LONG(long double, log, long double x);
MATH_LONG(long double, log10, long double x);
MATH_LONG(long double, log1p, long double x);
MATH_LONG(long double, log2, long double x);
MATH_LONG(long double, logb, long double x);
MATH_LONG(long double, cbrt, long double x);
MATH_LONG(long double, nearbyint, long double x);
MATH_LONG(long double, rint, long double x);
MATH_LONG(long double, round, long double x);
MATH_LONG(long double, sin, long double x);
MATH_LONG(long double, sqrt, long double x);
MATH_LONG(long double, tan, long double x);
MATH_LONG(long double, trunc, long double x);
MATH_LONG(long double, atan2, long double x, long double y);
MATH_LONG(long double, copysign, long double x, long double y);
MATH_LONG(long double, fdim, long double x, long double y);
MATH_LONG(long double, fmax, long double x, long double y);
MATH_LONG(long double, fmin, long double x, long double y);
MATH_LONG(long double, fmod, long double x, long double y);
MATH_LONG(long double, hypot, long double x, long double y);
MATH_LONG(long double, nextafter, long double x, long double y);
MATH_LONG(long double, pow, long double x, long double y);
MATH_LONG(long double, remainder, long double x, long double y);
MATH_LONG(long double, nexttoward, long double x, long double y);
MATH_LONG(long double, fma, long double x, long double y, long double z);
MATH_LONG(long double, frexp, long double x, int *exponent);
MATH_LONG(long double, ldexp, long double x, int exponent);
MATH_LONG(long double, modf, long double x, long double *whole);
MATH_LONG(long double, scalbn, long double x, int exponent);
MATH_LONG(long double, scalbln, long double x, long exponent);
MATH_LONG(long double, remquo, long double x, long double y, int *quotient);
MATH_LONG(long double, nan, const char *payload);
MATH_LONG(long, lrint, long double x);
MATH_LONG(long long, llrint, long double x);
MATH_LONG(long, lround, long double x);
MATH_LONG(long long, llround, long double x);
#undef MATH_LONG

#ifdef __cplusplus
}
#endif

#endif
