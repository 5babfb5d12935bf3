/* SPDX-License-Identifier: MIT */
/* Products and quotients of complex numbers, under the names that compilers call. Infinities and NaN follow from the
 * plain formulas, not from annex G of C11. */
#include <float.h>
#include <math.h>

/* Division (M. Baudin, R. L. Smith, "A robust complex division in Scilab", 2012): the larger part of the divisor is
 * divided out. If that ratio is too small to be exact, the products are reordered. Operands close to the limits of the
 * exponent range are scaled first. */
#define COMPLEX_ARITHMETIC(type, multiply, divide, part, larger, scale, exponent, smallest, lowest, highest)     \
    type _Complex multiply(type a, type b, type c, type d);                                                      \
    type _Complex divide(type a, type b, type c, type d);                                                        \
    type _Complex multiply(type a, type b, type c, type d)                                                       \
    {                                                                                                            \
        type _Complex result;                                                                                    \
        __real__ result = a * c - b * d;                                                                         \
        __imag__ result = a * d + b * c;                                                                         \
        return result;                                                                                           \
    }                                                                                                            \
    /* (a + b * (d / c)) / (c + d * (d / c)) for |c| >= |d| */                                                   \
    static type part(type a, type b, type c, type d)                                                             \
    {                                                                                                            \
        type ratio = d / c;                                                                                      \
        type divisor = c + d * ratio;                                                                            \
        return (a + (ratio >= smallest || ratio <= -smallest ? b * ratio : d * (b / c))) / divisor;              \
    }                                                                                                            \
    /* Power of two that scales two numbers away from overflow and subnormals; 0 for most. */                    \
    static int part##_shift(type x, type y)                                                                      \
    {                                                                                                            \
        x = x < 0 ? -x : x;                                                                                      \
        y = y < 0 ? -y : y;                                                                                      \
        type size = larger(x, y), rest = x < y ? x : y;                                                          \
        if (!isfinite(size) || size == 0)                                                                        \
            return 0;                                                                                            \
        int binary = exponent(size), lower = rest != 0 ? exponent(rest) : binary, up = highest / 4 - binary;     \
        return binary >= highest - 2 ? -3 : lower < lowest + 60 && up > 0 ? up : 0;                              \
    }                                                                                                            \
    type _Complex divide(type a, type b, type c, type d)                                                         \
    {                                                                                                            \
        type _Complex result;                                                                                    \
        int top = part##_shift(a, b), bottom = part##_shift(c, d), back = bottom - top;                          \
        a = scale(a, top);                                                                                       \
        b = scale(b, top);                                                                                       \
        c = scale(c, bottom);                                                                                    \
        d = scale(d, bottom);                                                                                    \
        if ((c < 0 ? -c : c) >= (d < 0 ? -d : d)) {                                                              \
            __real__ result = scale(part(a, b, c, d), back);                                                     \
            __imag__ result = scale(part(b, -a, c, d), back);                                                    \
        } else {                                                                                                 \
            __real__ result = scale(part(b, a, d, c), back);                                                     \
            __imag__ result = scale(part(-a, b, d, c), back);                                                    \
        }                                                                                                        \
        return result;                                                                                           \
    }

COMPLEX_ARITHMETIC(float, __mulsc3, __divsc3, quotient_single, fmaxf, ldexpf, ilogbf, FLT_MIN, FLT_MIN_EXP, FLT_MAX_EXP)
COMPLEX_ARITHMETIC(double, __muldc3, __divdc3, quotient_double, fmax, ldexp, ilogb, DBL_MIN, DBL_MIN_EXP, DBL_MAX_EXP)
