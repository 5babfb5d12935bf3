/* Products and quotients of complex numbers, which compilers call by these names (C11 annex G.5.1). */
#include "softfloat.h"

#include <math.h>

#define COMPLEX_ARITHMETIC(type, multiply, divide, absolute)                                                     \
    type _Complex multiply(type a, type b, type c, type d);                                                      \
    type _Complex divide(type a, type b, type c, type d);                                                        \
    type _Complex multiply(type a, type b, type c, type d)                                                       \
    {                                                                                                            \
        type _Complex result;                                                                                    \
        __real__ result = a * c - b * d;                                                                         \
        __imag__ result = a * d + b * c;                                                                         \
        return result;                                                                                           \
    }                                                                                                            \
    /* Smith's method: the divisor's larger part is divided out first, so that its square cannot overflow. */    \
    type _Complex divide(type a, type b, type c, type d)                                                         \
    {                                                                                                            \
        type _Complex result;                                                                                    \
        if (absolute(c) >= absolute(d)) {                                                                        \
            type ratio = d / c, scale = c + d * ratio;                                                           \
            __real__ result = (a + b * ratio) / scale;                                                           \
            __imag__ result = (b - a * ratio) / scale;                                                           \
        } else {                                                                                                 \
            type ratio = c / d, scale = d + c * ratio;                                                           \
            __real__ result = (a * ratio + b) / scale;                                                           \
            __imag__ result = (b * ratio - a) / scale;                                                           \
        }                                                                                                        \
        return result;                                                                                           \
    }

COMPLEX_ARITHMETIC(float, __mulsc3, __divsc3, fabsf)
COMPLEX_ARITHMETIC(double, __muldc3, __divdc3, fabs)
