/* SPDX-License-Identifier: MIT */
/* dsp.h: functions that compute in floating point. Formulas of windows: F. J. Harris, Proc. IEEE 66 (1978) 51-83. */
#include <dsp.h>
#include <math.h>
#include <stddef.h>

#define TWO_PI 6.28318531f

fractional Float2Fract(float x)
{
    x *= 32768.0f;
    if (x >= 32767.0f)
        return 32767;
    if (x <= -32768.0f)
        return -32768;
    return (fractional)(x < 0.0f ? x - 0.5f : x + 0.5f);
}

float Fract2Float(fractional x)
{
    return (float)x / 32768.0f;
}

/* a0 - a1 cos(2 pi i / (n-1)) + a2 cos(4 pi i / (n-1)); symmetric, so half of it is computed. */
static fractional *cosine_window(int n, fractional *window, float a0, float a1, float a2)
{
    for (int i = 0, j = n - 1; i <= j; i++, j--) {
        float angle = n > 1 ? TWO_PI * (float)i / (float)(n - 1) : 0.5f * TWO_PI;
        float value = a0 - a1 * cosf(angle);
        if (a2 != 0.0f)
            value += a2 * cosf(2.0f * angle);
        window[i] = window[j] = Float2Fract(value);
    }
    return window;
}

fractional *HanningInit(int n, fractional *window)
{
    return cosine_window(n, window, 0.5f, 0.5f, 0.0f);
}

fractional *HammingInit(int n, fractional *window)
{
    return cosine_window(n, window, 0.54f, 0.46f, 0.0f);
}

fractional *BlackmanInit(int n, fractional *window)
{
    return cosine_window(n, window, 0.42f, 0.5f, 0.08f);
}

fractional *BartlettInit(int n, fractional *window)
{
    for (int i = 0, j = n - 1; i <= j; i++, j--)
        window[i] = window[j] = Float2Fract(n > 1 ? 2.0f * (float)i / (float)(n - 1) : 1.0f);
    return window;
}

/* Modified Bessel function of the first kind, order 0, by its power series. */
static float bessel_i0(float x)
{
    float square = 0.25f * x * x;
    float term = 1.0f;
    float sum = 1.0f;
    for (float k = 1.0f; term > 1e-8f * sum; k += 1.0f) {
        term *= square / (k * k);
        sum += term;
    }
    return sum;
}

fractional *KaiserInit(int n, fractional *window, float beta)
{
    float whole = bessel_i0(beta);
    for (int i = 0, j = n - 1; i <= j; i++, j--) {
        float x = n > 1 ? 2.0f * (float)i / (float)(n - 1) - 1.0f : 0.0f;
        window[i] = window[j] = Float2Fract(bessel_i0(beta * sqrtf(1.0f - x * x)) / whole);
    }
    return window;
}

fractcomplex *TwidFactorInit(int log2n, fractcomplex *factors, int conjugate)
{
    int half = 1 << (log2n - 1);
    for (int k = 0; k < half; k++) {
        float angle = TWO_PI * (float)k / (float)(2 * (long)half);
        float sine = sinf(angle);
        factors[k].real = Float2Fract(cosf(angle));
        factors[k].imag = Float2Fract(conjugate ? sine : -sine);
    }
    return factors;
}
