/* SPDX-License-Identifier: MIT */
/* libq.h: functions of _Q16. Products and quotients are exact before rounding; transcendental functions compute in double. */
#include <libq.h>
#include <math.h>

#define FIXED _Q16
#define WIDE long long
#define REAL double
#define F(name) _Q16##name
#define R(name) name
#define LARGEST 0x7FFFFFFFl
#define SMALLEST (-LARGEST - 1)
#define PI 3.14159265358979324
#define UNITS 65536.0

long _Q16randomSeed = 21845;
short _Q16macSatFlag;

static _Q16 saturated(long long value)
{
    return value > LARGEST ? LARGEST : value < SMALLEST ? SMALLEST : (_Q16)value;
}

static _Q16 nearest(double x)
{
    double scaled = floor(x * UNITS + 0.5);
    return scaled >= LARGEST ? LARGEST : scaled <= SMALLEST ? SMALLEST : scaled == scaled ? (_Q16)scaled : 0;
}

static double real(_Q16 x)
{
    return (double)x * (1 / UNITS);
}

/* The angle x * pi, reduced to one turn. */
static double turned(_Q16 x)
{
    return real(x & 0x1FFFF) * PI;
}

#include "fixed_functions.h"

_Q16 _Q16ftoi(float x)
{
    return nearest(x);
}

float _itofQ16(_Q16 x)
{
    return (float)real(x);
}

/* The product with 16 fraction bits, rounded to the nearest. */
static long long product(_Q16 x, _Q16 y)
{
    return ((long long)x * y + 0x8000) >> 16;
}

_Q16 _IQ16mpy(_Q16 x, _Q16 y)
{
    return saturated(product(x, y));
}

_Q16 _Q16mac(_Q16 x, _Q16 y, _Q16 sum)
{
    return saturated(product(x, y) + sum);
}

_Q16 _Q16macNoSat(_Q16 x, _Q16 y, _Q16 sum)
{
    long long wide = product(x, y) + sum;
    if (saturated(wide) != wide)
        _Q16macSatFlag = 1;
    return (_Q16)wide;
}

_Q16 _Q16div(_Q16 x, _Q16 y)
{
    if (!y)
        return x < 0 ? SMALLEST : LARGEST;
    long long half = (y < 0) == (x < 0) ? y / 2 : -(long long)(y / 2);
    return saturated((x * 65536ll + half) / y);
}

_Q16 _Q16divmod(_Q16 x, _Q16 y, _Q16 *remainder)
{
    if (!y) {
        *remainder = 0;
        return x < 0 ? SMALLEST : LARGEST;
    }
    *remainder = (_Q16)(x * 65536ll % y);
    return saturated(x * 65536ll / y);
}

_Q16 _Q16reciprocalQ15(_Q15 x)
{
    return _Q16div(65536, (_Q16)x * 2);
}

_Q16 _Q16reciprocalQ16(_Q16 x)
{
    return _Q16div(65536, x);
}

_Q16 _Q16random(void)
{
    _Q16randomSeed = (long)((unsigned long)_Q16randomSeed * 1664525ul + 1013904223ul);
    return _Q16randomSeed;
}
