/* SPDX-License-Identifier: MIT */
/* libq.h: functions of _Q16. Products and quotients are exact before rounding; transcendental functions compute in double. */
#include <libq.h>
#include <math.h>

#define LARGEST 0x7FFFFFFFl
#define SMALLEST (-LARGEST - 1)
#define PI 3.14159265358979324
#define UNITS 65536.0

long _Q16randomSeed = 21845;
short _Q16shlSatFlag, _Q16shrSatFlag, _Q16macSatFlag;

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

/* The product with 16 fraction bits, rounded to the nearest. */
static long long product(_Q16 x, _Q16 y)
{
    return ((long long)x * y + 0x8000) >> 16;
}

_Q16 _Q16neg(_Q16 x)
{
    return saturated(-(long long)x);
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

/* x shifted left, for distances of either sign; `lost` tells whether bits of the value were shifted out on the left. */
static _Q16 shifted(_Q16 x, short distance, short *lost)
{
    if (distance <= 0)
        return distance <= -31 ? x >> 31 : x >> -distance;
    *lost = distance > 31 ? x != 0 : saturated((long long)x << distance) != (long long)x << distance;
    return distance > 31 ? 0 : (_Q16)((unsigned long)x << distance);
}

_Q16 _Q16shl(_Q16 x, short distance)
{
    short lost = 0;
    _Q16 result = shifted(x, distance, &lost);
    return lost ? (x < 0 ? SMALLEST : LARGEST) : result;
}

_Q16 _Q16shr(_Q16 x, short distance)
{
    return _Q16shl(x, distance < -32767 ? 32767 : (short)-distance);
}

_Q16 _Q16shlNoSat(_Q16 x, short distance)
{
    short lost = 0;
    _Q16 result = shifted(x, distance, &lost);
    if (lost)
        _Q16shlSatFlag = 1;
    return result;
}

_Q16 _Q16shrNoSat(_Q16 x, short distance)
{
    short lost = 0;
    _Q16 result = shifted(x, distance < -32767 ? 32767 : (short)-distance, &lost);
    if (lost)
        _Q16shrSatFlag = 1;
    return result;
}

_Q16 _Q16norm(_Q16 x)
{
    while (x && (x < 0 ? x >= SMALLEST / 2 : x <= LARGEST / 2))
        x *= 2;
    return x;
}

_Q16 _Q16exp(_Q16 x)
{
    return nearest(exp(real(x)));
}

_Q16 _Q16log(_Q16 x)
{
    return x <= 0 ? SMALLEST : nearest(log(real(x)));
}

_Q16 _Q16log10(_Q16 x)
{
    return x <= 0 ? SMALLEST : nearest(log10(real(x)));
}

_Q16 _Q16power(_Q16 x, _Q16 y)
{
    return nearest(pow(real(x), real(y)));
}

_Q16 _Q16sin(_Q16 x)
{
    return nearest(sin(real(x)));
}

_Q16 _Q16cos(_Q16 x)
{
    return nearest(cos(real(x)));
}

_Q16 _Q16tan(_Q16 x)
{
    return nearest(tan(real(x)));
}

/* The angle x * pi, reduced to one turn. */
static double turned(_Q16 x)
{
    return real(x & 0x1FFFF) * PI;
}

_Q16 _Q16sinPI(_Q16 x)
{
    return nearest(sin(turned(x)));
}

_Q16 _Q16cosPI(_Q16 x)
{
    return nearest(cos(turned(x)));
}

_Q16 _Q16tanPI(_Q16 x)
{
    return nearest(tan(turned(x)));
}

_Q16 _Q16asin(_Q16 x)
{
    return nearest(asin(real(x)));
}

_Q16 _Q16asinByPI(_Q16 x)
{
    return nearest(asin(real(x)) / PI);
}

_Q16 _Q16acos(_Q16 x)
{
    return nearest(acos(real(x)));
}

_Q16 _Q16acosByPI(_Q16 x)
{
    return nearest(acos(real(x)) / PI);
}

_Q16 _Q16atan(_Q16 x)
{
    return nearest(atan(real(x)));
}

_Q16 _Q16atanByPI(_Q16 x)
{
    return nearest(atan(real(x)) / PI);
}

/* atan(y / x) is in the right half plane, whatever the sign of x. */
static double quotient_angle(_Q16 x, _Q16 y)
{
    return x < 0 ? atan2(-(double)y, -(double)x) : atan2(y, x);
}

_Q16 _Q16atanYByX(_Q16 x, _Q16 y)
{
    return nearest(quotient_angle(x, y));
}

_Q16 _Q16atanYByXByPI(_Q16 x, _Q16 y)
{
    return nearest(quotient_angle(x, y) / PI);
}

_Q16 _Q16random(void)
{
    _Q16randomSeed = (long)((unsigned long)_Q16randomSeed * 1664525ul + 1013904223ul);
    return _Q16randomSeed;
}
