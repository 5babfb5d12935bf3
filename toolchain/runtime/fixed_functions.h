/* SPDX-License-Identifier: MIT */
/* The functions of libq.h that both types have. fixed_q15.c and fixed_q16.c define:
 * FIXED, the type, with its LARGEST and SMALLEST; WIDE, an integer type of twice its width; F(name), a function for FIXED;
 * REAL, the type of the computation; R(name), a function of math.h for REAL;
 * saturated(), nearest(), real(), and turned(x), the angle x * pi in REAL. */

enum { BITS = 8 * sizeof(FIXED) - 1 }; /* without the sign */

short F(shlSatFlag), F(shrSatFlag);

FIXED F(neg)(FIXED x)
{
    return saturated(-(WIDE)x);
}

/* x shifted left, for distances of either sign; `lost` tells whether bits of the value were shifted out on the left. */
static FIXED shifted(FIXED x, short distance, short *lost)
{
    if (distance <= 0)
        return distance <= -BITS ? x >> BITS : x >> -distance;
    *lost = distance > BITS ? x != 0 : saturated((WIDE)x << distance) != (WIDE)x << distance;
    return distance > BITS ? 0 : (FIXED)((unsigned long)x << distance);
}

static short opposite(short distance)
{
    return distance < -32767 ? 32767 : (short)-distance;
}

FIXED F(shl)(FIXED x, short distance)
{
    short lost = 0;
    FIXED result = shifted(x, distance, &lost);
    return lost ? (x < 0 ? SMALLEST : LARGEST) : result;
}

FIXED F(shr)(FIXED x, short distance)
{
    return F(shl)(x, opposite(distance));
}

FIXED F(shlNoSat)(FIXED x, short distance)
{
    short lost = 0;
    FIXED result = shifted(x, distance, &lost);
    if (lost)
        F(shlSatFlag) = 1;
    return result;
}

FIXED F(shrNoSat)(FIXED x, short distance)
{
    short lost = 0;
    FIXED result = shifted(x, opposite(distance), &lost);
    if (lost)
        F(shrSatFlag) = 1;
    return result;
}

FIXED F(norm)(FIXED x)
{
    while (x && (x < 0 ? x >= SMALLEST / 2 : x <= LARGEST / 2))
        x = (FIXED)(2 * x);
    return x;
}

FIXED F(exp)(FIXED x)
{
    return nearest(R(exp)(real(x)));
}

FIXED F(log)(FIXED x)
{
    return x <= 0 ? SMALLEST : nearest(R(log)(real(x)));
}

FIXED F(log10)(FIXED x)
{
    return x <= 0 ? SMALLEST : nearest(R(log10)(real(x)));
}

FIXED F(power)(FIXED x, FIXED y)
{
    return nearest(R(pow)(real(x), real(y)));
}

FIXED F(sin)(FIXED x)
{
    return nearest(R(sin)(real(x)));
}

FIXED F(sinPI)(FIXED x)
{
    return nearest(R(sin)(turned(x)));
}

FIXED F(cos)(FIXED x)
{
    return nearest(R(cos)(real(x)));
}

FIXED F(cosPI)(FIXED x)
{
    return nearest(R(cos)(turned(x)));
}

FIXED F(tan)(FIXED x)
{
    return nearest(R(tan)(real(x)));
}

FIXED F(tanPI)(FIXED x)
{
    return nearest(R(tan)(turned(x)));
}

FIXED F(asin)(FIXED x)
{
    return nearest(R(asin)(real(x)));
}

FIXED F(asinByPI)(FIXED x)
{
    return nearest(R(asin)(real(x)) / PI);
}

FIXED F(acos)(FIXED x)
{
    return nearest(R(acos)(real(x)));
}

FIXED F(acosByPI)(FIXED x)
{
    return nearest(R(acos)(real(x)) / PI);
}

FIXED F(atan)(FIXED x)
{
    return nearest(R(atan)(real(x)));
}

FIXED F(atanByPI)(FIXED x)
{
    return nearest(R(atan)(real(x)) / PI);
}

/* atan(y / x) is in the right half plane, whatever the sign of x. */
static REAL quotient_angle(FIXED x, FIXED y)
{
    return x < 0 ? R(atan2)(-(REAL)y, -(REAL)x) : R(atan2)(y, x);
}

FIXED F(atanYByX)(FIXED x, FIXED y)
{
    return nearest(quotient_angle(x, y));
}

FIXED F(atanYByXByPI)(FIXED x, FIXED y)
{
    return nearest(quotient_angle(x, y) / PI);
}
