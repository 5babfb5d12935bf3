/* SPDX-License-Identifier: MIT */
/* libq.h: functions of _Q15. Transcendental ones compute in float, whose 24 bits leave an error below 0.51 units. */
#include <libq.h>
#include <math.h>

#define FIXED _Q15
#define WIDE long
#define REAL float
#define F(name) _Q15##name
#define R(name) name##f
#define LARGEST 0x7FFF
#define SMALLEST (-LARGEST - 1)
#define PI 3.14159265f
#define UNITS 32768.0f
#define nearest _Q15ftoi
#define real _itofQ15
#define turned(x) (real(x) * PI)

short _Q15randomSeed = 21845;

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

#include "fixed_functions.h"

_Q15 _Q15abs(_Q15 x)
{
    return saturated(x < 0 ? -(long)x : x);
}

_Q15 _Q15add(_Q15 x, _Q15 y)
{
    return saturated((long)x + y);
}

_Q15 _Q15sub(_Q15 x, _Q15 y)
{
    return saturated((long)x - y);
}

_Q15 _Q15sqrt(_Q15 x)
{
    return x <= 0 ? 0 : _Q15ftoi(sqrtf(_itofQ15(x)));
}

_Q15 _Q15random(void)
{
    _Q15randomSeed = (short)((unsigned)_Q15randomSeed * 25173u + 13849u); /* of period 65536: Hull and Dobell's conditions */
    return _Q15randomSeed;
}

_Q15 _Q15atoi(const unsigned char *text)
{
    int negative = *text == '-';
    unsigned long fraction = 0; /* in units of 2^-16, rounded down */
    if (*text == '-' || *text == '+')
        text++;
    for (; *text >= '0' && *text <= '9'; text++)
        if (*text != '0')
            return negative ? SMALLEST : LARGEST; /* 1 or more */
    const unsigned char *first = text + (*text == '.'), *end = first;
    while (*end >= '0' && *end <= '9')
        end++;
    while (end > first)
        fraction = ((*--end - '0') * 65536ul + fraction) / 10;
    long value = (long)(fraction + 1) / 2;
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
