/* SPDX-License-Identifier: MIT */
/* Hyperbolic functions and their inverses (C11 7.12.5), and the cube root. Single precision uses the double functions. */
#include "softfloat.h"

#include <math.h>

#define ONLY_EXP 22     /* above it, exp(-x) is below half a unit in the last place of exp(x) */
#define ONLY_LOG 0x1p28 /* above it, sqrt(x*x + 1) is x */
#define NEAR_END 709    /* slightly below the argument at which exp overflows */

/* Return exp(x) / 2, also if exp(x) overflows. */
static double half_exp(double x)
{
    if (x < NEAR_END)
        return 0.5 * exp(x);
    double root = exp(0.5 * x);
    return 0.5 * root * root;
}

double sinh(double x)
{
    double size = fabs(x), value;
    if (size < ONLY_EXP) {
        double t = expm1(size);
        value = size < 1 ? 0.5 * (2 * t - t * t / (t + 1)) : 0.5 * (t + t / (t + 1));
    } else
        value = half_exp(size);
    return copysign(value, x);
}

double cosh(double x)
{
    double size = fabs(x);
    if (size < 0.5 * M_LN2) {
        double t = expm1(size);
        return 1 + t * t / (2 * (1 + t));
    }
    if (!(size < ONLY_EXP))
        return half_exp(size);
    double t = exp(size);
    return 0.5 * t + 0.5 / t;
}

double tanh(double x)
{
    double size = fabs(x), value = 1;
    if (isnan(x))
        return x;
    if (size < 1) {
        double t = expm1(-2 * size);
        value = -t / (t + 2);
    } else if (size < ONLY_EXP)
        value = 1 - 2 / (expm1(2 * size) + 2);
    return copysign(value, x);
}

double asinh(double x)
{
    double size = fabs(x), value;
    if (!(size < ONLY_LOG))
        value = log(size) + M_LN2;
    else if (size > 2)
        value = log(2 * size + 1 / (sqrt(size * size + 1) + size));
    else {
        double square = size * size;
        value = log1p(size + square / (1 + sqrt(1 + square)));
    }
    return copysign(value, x);
}

double acosh(double x)
{
    if (x < 1)
        return f64_value(F64_NAN);
    if (!(x < ONLY_LOG))
        return log(x) + M_LN2;
    if (x > 2)
        return log(2 * x - 1 / (x + sqrt(x * x - 1)));
    double t = x - 1;
    return log1p(t + sqrt(2 * t + t * t));
}

double atanh(double x)
{
    double size = fabs(x);
    if (size > 1)
        return f64_value(F64_NAN);
    double twice = size + size;
    double value = size < 0.5 ? log1p(twice + twice * size / (1 - size)) : log1p(twice / (1 - size));
    return copysign(0.5 * value, x);
}

double cbrt(double x)
{
    if (!isfinite(x) || x == 0)
        return x;
    int exponent;
    double m = frexp(fabs(x), &exponent);
    for (; exponent % 3; exponent++)
        m *= 0.5;
    /* m is in [1/8, 1); a linear estimate, then Halley steps, each of which triples the correct digits */
    double root = 0.4 + 0.61 * m;
    for (int i = 0; i < 2; i++) {
        double cube = root * root * root;
        root *= (cube + 2 * m) / (2 * cube + m);
    }
    root = f64_value(f64_bits(root) & ~0x7FFFFFFULL); /* short enough for an exact square */
    double other = m / (root * root);
    root += root * ((other - root) / (2 * root + other));
    return copysign(ldexp(root, exponent / 3), x);
}

float sinhf(float x)
{
    return (float)sinh(x);
}

float coshf(float x)
{
    return (float)cosh(x);
}

float tanhf(float x)
{
    return (float)tanh(x);
}

float asinhf(float x)
{
    return (float)asinh(x);
}

float acoshf(float x)
{
    return (float)acosh(x);
}

float atanhf(float x)
{
    return (float)atanh(x);
}

float cbrtf(float x)
{
    return (float)cbrt(x);
}
