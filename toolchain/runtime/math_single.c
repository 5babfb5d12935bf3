/* SPDX-License-Identifier: MIT */
/* math.h in single precision. Elementary functions have their own polynomials, so that programs that use only float link
 * no double arithmetic; powf, fmodf, exp2f, log2f, expm1f and log1pf use the double functions. Errors are below 4 units
 * in the last place for all arguments. */
#include "math_reduce.h"

#include <math.h>

static float polynomial(const float *c, int count, float z)
{
    float sum = c[--count];
    while (count)
        sum = sum * z + c[--count];
    return sum;
}

/* ln 2, split into parts whose products with small integers are exact. */
#define LN2_1 0.693115234375f
#define LN2_2 3.1946184945309415e-05f
#define PI 3.14159265f
#define PI_2 1.57079633f
#define PI_4 0.78539816f

float fabsf(float x)
{
    return f32_value(f32_bits(x) & ~F32_SIGN);
}

float copysignf(float magnitude, float sign)
{
    return f32_value((f32_bits(magnitude) & ~F32_SIGN) | (f32_bits(sign) & F32_SIGN));
}

float truncf(float x)
{
    uint32_t bits = f32_bits(x);
    int16_t exponent = (int16_t)((int16_t)(bits >> 23 & 0xFF) - F32_BIAS);
    if (exponent < 0)
        return f32_value(bits & F32_SIGN);
    return exponent >= 23 ? x : f32_value(bits & ~(F32_MANTISSA >> exponent));
}

float floorf(float x)
{
    float whole = truncf(x);
    return whole > x ? whole - 1 : whole;
}

float ceilf(float x)
{
    float whole = truncf(x);
    return whole < x ? copysignf(whole + 1, x) : whole;
}

float roundf(float x)
{
    float whole = truncf(x);
    return fabsf(x - whole) >= 0.5f ? copysignf(fabsf(whole) + 1, x) : whole;
}

float modff(float x, float *whole)
{
    *whole = truncf(x);
    return copysignf(*whole == x ? 0 : x - *whole, x);
}

float frexpf(float x, int *exponent)
{
    uint32_t bits = f32_bits(x), magnitude = bits & ~F32_SIGN;
    *exponent = 0;
    if (magnitude == 0 || magnitude >= F32_INF)
        return x;
    int16_t biased;
    uint32_t significand = __f32_unpack(magnitude, &biased);
    *exponent = biased - (F32_BIAS - 1);
    return f32_value((bits & F32_SIGN) | (uint32_t)(F32_BIAS - 1) << 23 | (significand >> 8 & F32_MANTISSA));
}

int ilogbf(float x)
{
    uint32_t magnitude = f32_bits(x) & ~F32_SIGN;
    if (magnitude == 0)
        return FP_ILOGB0;
    if (magnitude >= F32_INF)
        return magnitude > F32_INF ? FP_ILOGBNAN : __INT_MAX__;
    int16_t biased;
    __f32_unpack(magnitude, &biased);
    return biased - F32_BIAS;
}

float ldexpf(float x, int exponent)
{
    uint32_t bits = f32_bits(x), magnitude = bits & ~F32_SIGN;
    if (magnitude == 0 || magnitude >= F32_INF)
        return x;
    int16_t biased;
    uint32_t significand = __f32_unpack(magnitude, &biased);
    if (exponent > 600) /* more than the range of float */
        exponent = 600;
    if (exponent < -600)
        exponent = -600;
    return f32_value(__f32_pack(bits & F32_SIGN, (int16_t)(biased + exponent), significand >> 1));
}

float fminf(float x, float y)
{
    return isnan(y) || x < y ? x : y;
}

float fmaxf(float x, float y)
{
    return isnan(y) || x > y ? x : y;
}

float fmodf(float x, float y)
{
    return (float)fmod(x, y); /* double is exact, and float can represent the result */
}

/* Correctly rounded; each step computes one bit of the result, as in sqrt. */
float sqrtf(float x)
{
    uint32_t bits = f32_bits(x);
    if (bits > F32_INF || bits == 0)
        return bits == F32_SIGN || bits == 0 || (bits & ~F32_SIGN) > F32_INF ? x : f32_value(F32_NAN);
    if (bits == F32_INF)
        return x;
    int16_t exponent;
    uint32_t rest = __f32_unpack(bits, &exponent) >> 2;
    exponent = (int16_t)(exponent - F32_BIAS);
    if (exponent & 1)
        exponent--;
    else
        rest >>= 1;
    uint32_t root = 0;
    for (uint32_t bit = F32_TOP >> 1; bit >= 0x10; bit >>= 1) {
        uint32_t trial = root + (bit >> 1);
        if (rest >= trial) {
            rest -= trial;
            root += bit;
        }
        rest <<= 1;
    }
    if (rest)
        root |= 1;
    return f32_value(__f32_pack(0, (int16_t)(exponent / 2 + F32_BIAS), root << 1));
}

static const float sine[] = {-0.166666646f, 0.00833274530f, -0.000195872493f};
static const float cosine[] = {0.0416666646f, -0.00138883001f, 2.45472988e-05f};

/* 2/pi in digits of 16 bits, as many as the largest exponent needs. */
static const uint16_t two_over_pi[] = {0xA2F9, 0x836E, 0x4E44, 0x1529, 0xFC27, 0x57D1, 0xF534,
                                       0xDDC0, 0xDB62, 0x9599, 0x3C43, 0x9041, 0xFE51};

/* Split x = quadrant * pi/2 + *rest, |*rest| <= pi/4, for finite x; return quadrant mod 4. */
static int reduce(float x, float *rest)
{
    uint32_t bits = f32_bits(x), magnitude = bits & ~F32_SIGN;
    if (magnitude <= f32_bits(PI_4)) {
        *rest = x; /* exact, and keeps the sign of zero */
        return 0;
    }
    uint16_t digits[2];
    int16_t exponent = (int16_t)((int16_t)(magnitude >> 23) - (F32_BIAS + 23));
    int quadrant = __reduce_turns(two_over_pi, (magnitude & F32_MANTISSA) | (F32_MANTISSA + 1), &exponent, digits, 2);
    uint32_t significand = (uint32_t)digits[1] << 16 | digits[0], sign = bits & F32_SIGN;
    int negative = quadrant & REDUCED_NEGATIVE;
    if (significand & F32_SIGN) {
        significand >>= 1;
        exponent++;
    }
    *rest = f32_value(__f32_pack(negative ? sign ^ F32_SIGN : sign, (int16_t)(exponent + F32_BIAS - 2), significand));
    return (sign ? -quadrant : quadrant) & 3;
}

static float sine_of(float x, int quadrant)
{
    float z = x * x;
    float value = x;
    if (quadrant & 1)
        value = 1 - (0.5f * z - z * z * polynomial(cosine, 3, z));
    else if (x != 0) /* sin(-0) is -0 */
        value = x + x * z * polynomial(sine, 3, z);
    return quadrant & 2 ? -value : value;
}

float sinf(float x)
{
    float rest;
    if (!isfinite(x))
        return f32_value(F32_NAN);
    int quadrant = reduce(x, &rest);
    return sine_of(rest, quadrant);
}

float cosf(float x)
{
    float rest;
    if (!isfinite(x))
        return f32_value(F32_NAN);
    int quadrant = reduce(x, &rest);
    return sine_of(rest, quadrant + 1);
}

float tanf(float x)
{
    float rest;
    if (!isfinite(x))
        return f32_value(F32_NAN);
    int quadrant = reduce(x, &rest);
    return sine_of(rest, quadrant & 1) / sine_of(rest, (quadrant & 1) + 1);
}

static const float arc[] = {-0.333333318f, 0.199995398f, -0.142639312f, 0.107434678f, -0.0645105435f};
#define TAN_PI_8 0.41421356f

float atanf(float x)
{
    float z = fabsf(x), base = 0;
    if (isnan(x))
        return x;
    if (z > 1 / TAN_PI_8) {
        base = PI_2;
        z = -1 / z;
    } else if (z > TAN_PI_8) {
        base = PI_4;
        z = (z - 1) / (z + 1);
    }
    float square = z * z;
    return copysignf(base + (z + z * square * polynomial(arc, 5, square)), x);
}

float atan2f(float y, float x)
{
    if (isnan(x) || isnan(y))
        return f32_value(F32_NAN);
    float angle;
    if (y == 0)
        angle = signbit(x) ? PI : 0;
    else if (x == 0)
        angle = PI_2;
    else if (isinf(x) && isinf(y))
        angle = x > 0 ? PI_4 : 3 * PI_4;
    else {
        angle = atanf(fabsf(y / x));
        if (x < 0)
            angle = PI - angle;
    }
    return copysignf(angle, y);
}

float asinf(float x)
{
    return fabsf(x) > 1 ? f32_value(F32_NAN) : atan2f(x, sqrtf((1 - x) * (1 + x)));
}

float acosf(float x)
{
    return fabsf(x) > 1 ? f32_value(F32_NAN) : atan2f(sqrtf((1 - x) * (1 + x)), x);
}

static const float exponential[] = {0.5f, 0.166665766f, 0.0416665541f, 0.00836324667f, 0.00139262681f};

float expf(float x)
{
    if (isnan(x))
        return x;
    if (x > 89)
        return HUGE_VALF;
    if (x < -104)
        return 0;
    float twos = roundf(x * 1.44269504f);
    float rest = (x - twos * LN2_1) - twos * LN2_2;
    return ldexpf(1 + (rest + rest * rest * polynomial(exponential, 5, rest)), (int)twos);
}

static const float logarithm[] = {0.666666851f, 0.399887733f, 0.295802775f};

float logf(float x)
{
    if (isnan(x) || x < 0)
        return f32_value(F32_NAN);
    if (x == 0)
        return -HUGE_VALF;
    if (isinf(x))
        return x;
    int twos;
    float m = frexpf(x, &twos);
    if (m < 0.70710678f) {
        m *= 2;
        twos--;
    }
    float f = m - 1;
    float s = f / (2 + f), z = s * s;
    /* log(1 + f) = 2 s + s^3 (...) = f - s (f - s^2 (...)) */
    return twos * LN2_1 + ((twos * LN2_2 - s * (f - z * polynomial(logarithm, 3, z))) + f);
}

float log10f(float x)
{
    return logf(x) * 0.434294482f;
}

float exp2f(float x)
{
    return (float)exp2(x);
}

float expm1f(float x)
{
    return (float)expm1(x);
}

float log2f(float x)
{
    return (float)log2(x);
}

float log1pf(float x)
{
    return (float)log1p(x);
}

float powf(float x, float y)
{
    return (float)pow(x, y);
}

float hypotf(float x, float y)
{
    x = fabsf(x);
    y = fabsf(y);
    if (isinf(x) || isinf(y))
        return HUGE_VALF;
    float large = fmaxf(x, y), small = fminf(x, y);
    if (large == 0 || isnan(x) || isnan(y))
        return x + y;
    float ratio = small / large;
    return large * sqrtf(1 + ratio * ratio);
}
