/* SPDX-License-Identifier: MIT */
/* Elementary functions in double precision (C11 7.12.4-7.12.7). Polynomials are Chebyshev interpolants computed for
 * these intervals with 60 digits. Errors are below 4 units in the last place for all arguments. */
#include "math_reduce.h"

#include <math.h>

/* c[0] + c[1] z + ... + c[count-1] z^(count-1) */
static double polynomial(const double *c, int count, double z)
{
    double sum = c[--count];
    while (count)
        sum = sum * z + c[--count];
    return sum;
}

/* ln 2, split into parts whose products with small integers are exact. */
#define LN2_1 0.6931471803691238
#define LN2_2 1.9082149292705877e-10
#define ONE_OVER_LN2 1.44269504088896340736

static const double sine[] = {-0.16666666666666666,    0.0083333333333309185,   -0.00019841269836712495,
                              2.755731607868067e-06,   -2.5051126876085335e-08, 1.5917771759341687e-10};
static const double cosine[] = {0.041666666666666664,    -0.0013888888888887378, 2.4801587298736822e-05,
                                -2.7557317256781059e-07, 2.087614315748681e-09,  -1.1382408611707654e-11};

/* 2/pi in digits of 16 bits, as many as the largest exponent needs. */
static const uint16_t two_over_pi[] = {
    0xA2F9, 0x836E, 0x4E44, 0x1529, 0xFC27, 0x57D1, 0xF534, 0xDDC0, 0xDB62, 0x9599, 0x3C43, 0x9041,
    0xFE51, 0x63AB, 0xDEBB, 0xC561, 0xB724, 0x6E3A, 0x424D, 0xD2E0, 0x0649, 0x2EEA, 0x09D1, 0x921C,
    0xFE1D, 0xEB1C, 0xB129, 0xA73E, 0xE882, 0x35F5, 0x2EBB, 0x4484, 0xE99C, 0x7026, 0xB45F, 0x7E41,
    0x3991, 0xD639, 0x8353, 0x39F4, 0x9C84, 0x5F8B, 0xBDF9, 0x283B, 0x1FF8, 0x97FF, 0xDE05, 0x980F,
    0xEF2F, 0x118B, 0x5A0A, 0x6D1F, 0x6D36, 0x7ECF, 0x27CB, 0x09B7, 0x4F46, 0x3F66, 0x9E5F, 0xEA2D,
    0x7527, 0xBAC7, 0xEBE5, 0xF17B, 0x3D07, 0x39F7, 0x8A52, 0x92EA, 0x6BFB, 0x5FB1, 0x1F8D, 0x5D08,
};

/* Split x = quadrant * pi/2 + *rest, |*rest| <= pi/4, for finite x; return quadrant mod 4. */
static int reduce(double x, double *rest)
{
    uint64_t bits = f64_bits(x), magnitude = bits & ~F64_SIGN;
    if (magnitude <= f64_bits(M_PI_4)) {
        *rest = x; /* exact, and keeps the sign of zero */
        return 0;
    }
    uint16_t digits[4];
    int16_t exponent = (int16_t)((int16_t)(magnitude >> 52) - (F64_BIAS + 52));
    int quadrant = __reduce_turns(two_over_pi, (magnitude & F64_MANTISSA) | (F64_MANTISSA + 1), &exponent, digits, 4);
    uint64_t significand = 0, sign = bits & F64_SIGN;
    for (int16_t i = 4; i--;)
        significand = significand << 16 | digits[i];
    int negative = quadrant & REDUCED_NEGATIVE;
    if (significand & F64_SIGN) {
        significand >>= 1;
        exponent++;
    }
    *rest = f64_value(__f64_pack(negative ? sign ^ F64_SIGN : sign, (int16_t)(exponent + F64_BIAS - 2), significand));
    return (sign ? -quadrant : quadrant) & 3;
}

/* Return sin(x + quadrant * pi/2) for |x| <= pi/4. */
static double sine_of(double x, int quadrant)
{
    double z = x * x;
    double value = x;
    if (quadrant & 1)
        value = 1 - (0.5 * z - z * z * polynomial(cosine, 6, z));
    else if (x != 0) /* sin(-0) is -0 */
        value = x + x * z * polynomial(sine, 6, z);
    return quadrant & 2 ? -value : value;
}

double sin(double x)
{
    double rest;
    if (!isfinite(x))
        return f64_value(F64_NAN);
    int quadrant = reduce(x, &rest);
    return sine_of(rest, quadrant);
}

double cos(double x)
{
    double rest;
    if (!isfinite(x))
        return f64_value(F64_NAN);
    int quadrant = reduce(x, &rest);
    return sine_of(rest, quadrant + 1);
}

double tan(double x)
{
    double rest;
    if (!isfinite(x))
        return f64_value(F64_NAN);
    int quadrant = reduce(x, &rest);
    return sine_of(rest, quadrant & 1) / sine_of(rest, (quadrant & 1) + 1);
}

static const double arc[] = {-0.33333333333333331,  0.19999999999995505,   -0.14285714284662937, 0.1111111101496651,
                             -0.090909045663502733, 0.076921829173827644,  -0.066645075966273781, 0.058581154692669106,
                             -0.050852747691745775, 0.039226604671811355,  -0.019170699464250367};

/* tan(pi/8): the polynomial is used below it; between it and its inverse, atan x = pi/4 + atan((x-1)/(x+1)). */
#define TAN_PI_8 0.41421356237309503

double atan(double x)
{
    double z = fabs(x), base = 0;
    if (isnan(x))
        return x;
    if (z > 1 / TAN_PI_8) {
        base = M_PI_2;
        z = -1 / z;
    } else if (z > TAN_PI_8) {
        base = M_PI_4;
        z = (z - 1) / (z + 1);
    }
    double square = z * z;
    return copysign(base + (z + z * square * polynomial(arc, 11, square)), x);
}

double atan2(double y, double x)
{
    if (isnan(x) || isnan(y))
        return f64_value(F64_NAN);
    double angle;
    if (y == 0)
        angle = signbit(x) ? M_PI : 0;
    else if (x == 0)
        angle = M_PI_2;
    else if (isinf(x) && isinf(y))
        angle = x > 0 ? M_PI_4 : 3 * M_PI_4;
    else {
        angle = atan(fabs(y / x));
        if (x < 0)
            angle = M_PI - angle;
    }
    return copysign(angle, y);
}

double asin(double x)
{
    return fabs(x) > 1 ? f64_value(F64_NAN) : atan2(x, sqrt((1 - x) * (1 + x)));
}

double acos(double x)
{
    return fabs(x) > 1 ? f64_value(F64_NAN) : atan2(sqrt((1 - x) * (1 + x)), x);
}

static const double exponential[] = {0.5,
                                     0.16666666666666671,
                                     0.041666666666666671,
                                     0.0083333333333260699,
                                     0.0013888888888883703,
                                     0.00019841269875048905,
                                     2.4801587325710759e-05,
                                     2.7557255110978891e-06,
                                     2.7557273436570519e-07,
                                     2.5105337244665209e-08,
                                     2.0914772832237191e-09};

/* Return exp(x) - 1 for |x| <= (ln 2) / 2. */
static double less_one(double x)
{
    return x + x * x * polynomial(exponential, 11, x);
}

/* Return exp(x + tail) for a tail below one unit in the last place of x. */
static double exponential_of(double x, double tail)
{
    if (isnan(x))
        return x;
    if (x > 710)
        return HUGE_VAL;
    if (x < -750)
        return 0;
    double twos = round(x * ONE_OVER_LN2);
    double rest = ((x - twos * LN2_1) - twos * LN2_2) + tail;
    return ldexp(1 + less_one(rest), (int)twos);
}

double exp(double x)
{
    return exponential_of(x, 0);
}

double expm1(double x)
{
    if (isnan(x) || x == 0) /* the result for -0 is -0 */
        return x;
    if (x > 40)
        return exp(x); /* subtracting 1 changes less than half a unit in the last place */
    if (x < -40)
        return -1;
    double twos = round(x * ONE_OVER_LN2);
    double value = less_one((x - twos * LN2_1) - twos * LN2_2);
    return twos == 0 ? value : ldexp(value, (int)twos) + (ldexp(1, (int)twos) - 1);
}

double exp2(double x)
{
    if (isnan(x))
        return x;
    if (x >= 1024)
        return HUGE_VAL;
    if (x < -1100)
        return 0;
    double twos = round(x);
    return ldexp(1 + less_one((x - twos) * M_LN2), (int)twos);
}

static const double logarithm[] = {0.66666666666666696, 0.39999999999899311, 0.28571428626063622, 0.22222211120421034,
                                   0.18182890171914962, 0.15331686825116089, 0.14616879374036285};

/* Return the upper 26 bits, so that products of two results are exact. */
static double upper(double x)
{
    return f64_value(f64_bits(x) & ~0x7FFFFFFULL);
}

/* 2/3 as the sum of a number with 26 bits and a correction. */
#define TWO_THIRDS_1 0.6666666567325592
#define TWO_THIRDS_2 9.934107462565104e-09

/* Coefficients of s^5, s^7 ... in log(1 + f) - 2 s - 2/3 s^3. */
static const double logarithm_rest[] = {0.4, 0.28571428571429364, 0.22222222221656232, 0.18181818335314404,
                                        0.15384594970895457, 0.13334804238225345, 0.11706248540922386, 0.11723051028097753};

/* Return log(x) for finite x > 0; with s = f / (2 + f), log(1 + f) = 2 atanh(s) = 2 s + s^3 (...). With `tail`, the result
 * plus *tail has 64 correct bits, which pow needs: it multiplies the error by up to 745. */
static double logarithm_of(double x, double *tail)
{
    int twos;
    double m = frexp(x, &twos);
    if (m < M_SQRT2 / 2) {
        m *= 2;
        twos--;
    }
    double f = m - 1, sum = m + 1;
    double s = f / sum, s_high = upper(s);
    double sum_high = upper(sum), sum_low = m - (sum_high - 1);
    double s_low = ((f - s_high * sum_high) - s_high * sum_low) / sum;
    double z = s * s;
    double large = twos * LN2_1, high = large + 2 * s_high;
    double low = large != 0 ? 2 * s_high - (high - large) : 0, small = 2 * s_low + twos * LN2_2;
    if (!tail)
        return high + (low + (small + s * z * polynomial(logarithm, 7, z)));
    /* 2/3 s^3 as the sum of `cubic` and `cubic_low`; products of two numbers with 26 bits are exact */
    double square = s_high * s_high, square_high = upper(square);
    double cube = square_high * s_high, cube_high = upper(cube);
    double cube_low = (cube - cube_high) + ((square - square_high) * s_high + (square + (s_high + s) * s) * s_low);
    double cubic = cube_high * TWO_THIRDS_1;
    double cubic_low = cube_low * TWO_THIRDS_1 + (cube_high + cube_low) * TWO_THIRDS_2;
    double total = high + cubic;
    low += cubic - (total - high) + (small + (cubic_low + s * z * z * polynomial(logarithm_rest, 8, z)));
    double result = total + low;
    *tail = low - (result - total);
    return result;
}

double log(double x)
{
    if (isnan(x) || x < 0)
        return f64_value(F64_NAN);
    if (x == 0)
        return -HUGE_VAL;
    return isinf(x) ? x : logarithm_of(x, 0);
}

double log10(double x)
{
    return log(x) * 0.43429448190325182765;
}

double log2(double x)
{
    int twos;
    if (!(x > 0) || isinf(x))
        return log(x);
    double m = frexp(x, &twos);
    if (m < M_SQRT2 / 2) {
        m *= 2;
        twos--;
    }
    return twos + logarithm_of(m, 0) * ONE_OVER_LN2; /* the integer part is exact */
}

/* 1 + x loses low bits of x, so the result is scaled by x / (sum - 1). */
double log1p(double x)
{
    volatile double sum = 1 + x;
    if (sum == 1 || sum == HUGE_VAL) /* the result for -0 is -0 */
        return x;
    return sum > 0 ? log(sum) * (x / (sum - 1)) : log(sum);
}

/* Return 2 for even integers, 1 for odd integers, 0 for other numbers. */
static int parity(double y)
{
    if (fmod(y, 1) != 0 || isinf(y))
        return isinf(y) ? 2 : 0;
    return fmod(y, 2) == 0 ? 2 : 1;
}

double pow(double x, double y)
{
    if (y == 0 || x == 1)
        return 1;
    if (isnan(x) || isnan(y))
        return f64_value(F64_NAN);
    int kind = parity(y);
    double sign = x;
    if (!(signbit(x) && kind == 1))
        sign = 1;
    double base = fabs(x);
    if (isinf(y)) {
        if (base == 1)
            return 1;
        return (base > 1) == (y > 0) ? HUGE_VAL : 0;
    }
    if (base == 0 || isinf(base))
        return copysign((base == 0) == (y > 0) ? 0 : HUGE_VAL, sign);
    if (x < 0 && kind == 0)
        return f64_value(F64_NAN);
    double tail, high = logarithm_of(base, &tail);
    double product = y * high;
    if (fabs(product) > 800)
        return copysign(product > 0 ? HUGE_VAL : 0, sign);
    double y_high = upper(y), log_high = upper(high);
    double error = ((y_high * log_high - product) + y_high * (high - log_high) + (y - y_high) * log_high) +
                   (y - y_high) * (high - log_high);
    double power = exponential_of(product, error + y * tail);
    if (y > 0 && power < 9007199254740992.0 && trunc(x) == x && trunc(y) == y)
        power = round(power); /* the exact result is an integer and representable */
    return copysign(power, sign);
}

double hypot(double x, double y)
{
    x = fabs(x);
    y = fabs(y);
    if (isinf(x) || isinf(y))
        return HUGE_VAL;
    double large = fmax(x, y), small = fmin(x, y);
    if (large == 0 || isnan(x) || isnan(y))
        return x + y;
    double ratio = small / large;
    return large * sqrt(1 + ratio * ratio);
}
