/* SPDX-License-Identifier: MIT */
/* The functions of complex.h for one type; complex_double.c and complex_single.c define REAL and F(name), the name of a
 * function for that type. Inverse functions after W. Kahan, "Branch cuts for complex elementary functions", 1987. */
#include <complex.h>
#include <math.h>

static REAL _Complex pair(REAL real, REAL imaginary)
{
    REAL _Complex z;
    __real__ z = real;
    __imag__ z = imaginary;
    return z;
}

REAL F(creal)(REAL _Complex z)
{
    return __real__ z;
}

REAL F(cimag)(REAL _Complex z)
{
    return __imag__ z;
}

REAL _Complex F(conj)(REAL _Complex z)
{
    return pair(__real__ z, -__imag__ z);
}

REAL _Complex F(cproj)(REAL _Complex z)
{
    if (!isinf(__real__ z) && !isinf(__imag__ z))
        return z;
    return pair((REAL)INFINITY, F(copysign)(0, __imag__ z));
}

REAL F(cabs)(REAL _Complex z)
{
    return F(hypot)(__real__ z, __imag__ z);
}

REAL F(carg)(REAL _Complex z)
{
    return F(atan2)(__imag__ z, __real__ z);
}

REAL _Complex F(csqrt)(REAL _Complex z)
{
    REAL x = __real__ z, y = __imag__ z;
    if (x == 0 && y == 0)
        return pair(0, y);
    if (isinf(y))
        return pair(F(fabs)(y), y);
    REAL root = F(sqrt)((REAL)0.5 * (F(fabs)(x) + F(hypot)(x, y)));
    if (x >= 0)
        return pair(root, y / (2 * root));
    return pair(F(fabs)(y) / (2 * root), F(copysign)(root, y));
}

REAL _Complex F(cexp)(REAL _Complex z)
{
    REAL size = F(exp)(__real__ z), angle = __imag__ z;
    return angle == 0 ? pair(size, angle) : pair(size * F(cos)(angle), size * F(sin)(angle));
}

REAL _Complex F(clog)(REAL _Complex z)
{
    return pair(F(log)(F(cabs)(z)), F(carg)(z));
}

REAL _Complex F(cpow)(REAL _Complex z, REAL _Complex exponent)
{
    if (__real__ z == 0 && __imag__ z == 0)
        return __real__ exponent == 0 && __imag__ exponent == 0 ? pair(1, 0) : pair(0, 0);
    return F(cexp)(exponent * F(clog)(z));
}

REAL _Complex F(csinh)(REAL _Complex z)
{
    REAL x = __real__ z, y = __imag__ z;
    return pair(F(sinh)(x) * F(cos)(y), F(cosh)(x) * F(sin)(y));
}

REAL _Complex F(ccosh)(REAL _Complex z)
{
    REAL x = __real__ z, y = __imag__ z;
    return pair(F(cosh)(x) * F(cos)(y), F(sinh)(x) * F(sin)(y));
}

REAL _Complex F(ctanh)(REAL _Complex z)
{
    REAL x = __real__ z, y = __imag__ z;
    if (F(fabs)(x) > LARGE) /* sinh and cosh overflow; the result differs from +-1 by less than half a unit */
        return pair(F(copysign)(1, x), F(copysign)(0, F(sin)(2 * y)));
    REAL t = F(tan)(y), s = F(sinh)(x), beta = 1 + t * t, rho = F(sqrt)(1 + s * s), divisor = 1 + beta * s * s;
    return pair(beta * rho * s / divisor, t / divisor);
}

/* f(z) = -i g(iz) for the circular functions. */
static REAL _Complex turned(REAL _Complex z)
{
    return pair(-__imag__ z, __real__ z);
}

static REAL _Complex turned_back(REAL _Complex z)
{
    return pair(__imag__ z, -__real__ z);
}

REAL _Complex F(csin)(REAL _Complex z)
{
    return turned_back(F(csinh)(turned(z)));
}

REAL _Complex F(ccos)(REAL _Complex z)
{
    return F(ccosh)(turned(z));
}

REAL _Complex F(ctan)(REAL _Complex z)
{
    return turned_back(F(ctanh)(turned(z)));
}

REAL _Complex F(casin)(REAL _Complex z)
{
    REAL _Complex below = F(csqrt)(pair(1 - __real__ z, -__imag__ z)), above = F(csqrt)(pair(1 + __real__ z, __imag__ z));
    REAL real = __real__ below * __real__ above - __imag__ below * __imag__ above;
    REAL imaginary = __real__ below * __imag__ above - __imag__ below * __real__ above;
    return pair(F(atan2)(__real__ z, real), F(asinh)(imaginary));
}

REAL _Complex F(cacos)(REAL _Complex z)
{
    REAL _Complex below = F(csqrt)(pair(1 - __real__ z, -__imag__ z)), above = F(csqrt)(pair(1 + __real__ z, __imag__ z));
    REAL imaginary = __real__ above * __imag__ below - __imag__ above * __real__ below;
    return pair(2 * F(atan2)(__real__ below, __real__ above), F(asinh)(imaginary));
}

REAL _Complex F(casinh)(REAL _Complex z)
{
    return turned_back(F(casin)(turned(z)));
}

REAL _Complex F(cacosh)(REAL _Complex z)
{
    REAL _Complex below = F(csqrt)(pair(__real__ z - 1, __imag__ z)), above = F(csqrt)(pair(__real__ z + 1, __imag__ z));
    REAL real = __real__ below * __real__ above + __imag__ below * __imag__ above;
    return pair(F(asinh)(real), 2 * F(atan2)(__imag__ below, __real__ above));
}

REAL _Complex F(catanh)(REAL _Complex z)
{
    REAL x = __real__ z, y = __imag__ z, size = F(fabs)(x), rest = 1 - size;
    REAL real = (REAL)0.25 * F(log1p)(4 * size / (rest * rest + y * y));
    return pair(F(copysign)(real, x), (REAL)0.5 * F(atan2)(2 * y, rest * (1 + size) - y * y));
}

REAL _Complex F(catan)(REAL _Complex z)
{
    return turned_back(F(catanh)(turned(z)));
}
