/* SPDX-License-Identifier: MIT */
/* libq.h: functions of _Q15. Transcendental ones compute in float, whose 24 bits leave an error below 0.51 units. */
#include <libq.h>
#include <math.h>

#define LARGEST 0x7FFF
#define SMALLEST (-LARGEST - 1)
#define PI 3.14159265f
#define UNITS 32768.0f

short _Q15randomSeed = 21845;
short _Q15shlSatFlag, _Q15shrSatFlag;

static _Q15 saturated(long value)
{
    return (_Q15)(value > LARGEST ? LARGEST : value < SMALLEST ? SMALLEST : value);
}

_Q15 _Q15ftoi(float x)
{
    float scaled = floorf(x * UNITS + 0.5f);
    return scaled >= UNITS ? LARGEST : scaled < -UNITS ? SMALLEST : scaled == scaled ? (_Q15)scaled : 0;
}

float _itofQ15(_Q15 x)
{
    return (float)x * (1 / UNITS);
}

_Q15 _Q15abs(_Q15 x)
{
    return saturated(x < 0 ? -(long)x : x);
}

_Q15 _Q15neg(_Q15 x)
{
    return saturated(-(long)x);
}

_Q15 _Q15add(_Q15 x, _Q15 y)
{
    return saturated((long)x + y);
}

_Q15 _Q15sub(_Q15 x, _Q15 y)
{
    return saturated((long)x - y);
}

/* x shifted left, for distances of either sign; `lost` tells whether bits of the value were shifted out on the left. */
static _Q15 shifted(_Q15 x, short distance, short *lost)
{
    if (distance <= 0)
        return distance <= -15 ? (_Q15)(x >> 15) : (_Q15)(x >> -distance);
    long wide = distance > 15 ? (long)x << 15 << (x != 0) : (long)x << distance;
    *lost = saturated(wide) != wide;
    return distance > 15 ? 0 : (_Q15)wide;
}

_Q15 _Q15shl(_Q15 x, short distance)
{
    short lost = 0;
    _Q15 result = shifted(x, distance, &lost);
    return lost ? (x < 0 ? SMALLEST : LARGEST) : result;
}

_Q15 _Q15shr(_Q15 x, short distance)
{
    return _Q15shl(x, distance < -32767 ? 32767 : (short)-distance);
}

_Q15 _Q15shlNoSat(_Q15 x, short distance)
{
    short lost = 0;
    _Q15 result = shifted(x, distance, &lost);
    if (lost)
        _Q15shlSatFlag = 1;
    return result;
}

_Q15 _Q15shrNoSat(_Q15 x, short distance)
{
    short lost = 0;
    _Q15 result = shifted(x, distance < -32767 ? 32767 : (short)-distance, &lost);
    if (lost)
        _Q15shrSatFlag = 1;
    return result;
}

_Q15 _Q15norm(_Q15 x)
{
    while (x && (x < 0 ? x >= SMALLEST / 2 : x <= LARGEST / 2))
        x = (_Q15)(2 * x);
    return x;
}

_Q15 _Q15sqrt(_Q15 x)
{
    return x <= 0 ? 0 : _Q15ftoi(sqrtf(_itofQ15(x)));
}

_Q15 _Q15exp(_Q15 x)
{
    return _Q15ftoi(expf(_itofQ15(x)));
}

_Q15 _Q15log(_Q15 x)
{
    return x <= 0 ? SMALLEST : _Q15ftoi(logf(_itofQ15(x)));
}

_Q15 _Q15log10(_Q15 x)
{
    return x <= 0 ? SMALLEST : _Q15ftoi(log10f(_itofQ15(x)));
}

_Q15 _Q15power(_Q15 x, _Q15 y)
{
    return _Q15ftoi(powf(_itofQ15(x), _itofQ15(y)));
}

_Q15 _Q15sin(_Q15 x)
{
    return _Q15ftoi(sinf(_itofQ15(x)));
}

_Q15 _Q15sinPI(_Q15 x)
{
    return _Q15ftoi(sinf(_itofQ15(x) * PI));
}

_Q15 _Q15cos(_Q15 x)
{
    return _Q15ftoi(cosf(_itofQ15(x)));
}

_Q15 _Q15cosPI(_Q15 x)
{
    return _Q15ftoi(cosf(_itofQ15(x) * PI));
}

_Q15 _Q15tan(_Q15 x)
{
    return _Q15ftoi(tanf(_itofQ15(x)));
}

_Q15 _Q15tanPI(_Q15 x)
{
    return _Q15ftoi(tanf(_itofQ15(x) * PI));
}

_Q15 _Q15asin(_Q15 x)
{
    return _Q15ftoi(asinf(_itofQ15(x)));
}

_Q15 _Q15asinByPI(_Q15 x)
{
    return _Q15ftoi(asinf(_itofQ15(x)) / PI);
}

_Q15 _Q15acos(_Q15 x)
{
    return _Q15ftoi(acosf(_itofQ15(x)));
}

_Q15 _Q15acosByPI(_Q15 x)
{
    return _Q15ftoi(acosf(_itofQ15(x)) / PI);
}

_Q15 _Q15atan(_Q15 x)
{
    return _Q15ftoi(atanf(_itofQ15(x)));
}

_Q15 _Q15atanByPI(_Q15 x)
{
    return _Q15ftoi(atanf(_itofQ15(x)) / PI);
}

/* atan(y / x) is in the right half plane, whatever the sign of x. */
static float quotient_angle(_Q15 x, _Q15 y)
{
    return x < 0 ? atan2f(-(float)y, -(float)x) : atan2f(y, x);
}

_Q15 _Q15atanYByX(_Q15 x, _Q15 y)
{
    return _Q15ftoi(quotient_angle(x, y));
}

_Q15 _Q15atanYByXByPI(_Q15 x, _Q15 y)
{
    return _Q15ftoi(quotient_angle(x, y) / PI);
}

_Q15 _Q15random(void)
{
    _Q15randomSeed = (short)((unsigned)_Q15randomSeed * 25173u + 13849u); /* of period 65536: Hull and Dobell's conditions */
    return _Q15randomSeed;
}

_Q15 _Q15atoi(const unsigned char *text)
{
    int negative = *text == '-';
    unsigned long digits = 0, scale = 1;
    if (*text == '-' || *text == '+')
        text++;
    for (; *text >= '0' && *text <= '9'; text++)
        if (*text != '0')
            return negative ? SMALLEST : LARGEST; /* 1 or more */
    if (*text == '.')
        for (text++; *text >= '0' && *text <= '9' && scale < 100000; text++, scale *= 10)
            digits = digits * 10 + (*text - '0');
    long value = (long)((digits * 32768 + scale / 2) / scale);
    return saturated(negative ? -value : value);
}

void _itoaQ15(_Q15 x, unsigned char *text)
{
    unsigned fraction = x < 0 ? -(unsigned)x : (unsigned)x;
    if (x < 0)
        *text++ = '-';
    *text++ = (unsigned char)('0' + (fraction >> 15));
    *text++ = '.';
    fraction <<= 1; /* now 16 bits of fraction */
    do {
        unsigned long next = fraction * 10ul;
        *text++ = (unsigned char)('0' + (next >> 16));
        fraction = (unsigned)next;
    } while (fraction);
    *text = 0;
}
