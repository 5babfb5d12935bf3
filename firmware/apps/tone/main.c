/* Which tone does microphone 0 hear? A low-pass filter, a window and an FFT of the DSP library; README.md. */
#include <openswarm.h>

#include <analog.h>
#include <dsp.h>
#include <stdio.h>
#include <string.h>

enum { LOG2_BLOCK = 7, BLOCK = 1 << LOG2_BLOCK, TAPS = 24, CUTOFF_HZ = 400, SAMPLES_HZ = 1280, STACK = 320 };

static fractional heard[2][BLOCK];
static volatile uint16 filled, writing; /* samples of the block in progress; its number, 0 or 1 */

static fractional coefficients[TAPS] __attribute__((space(xmemory)));
static fractional window[BLOCK] __attribute__((space(xmemory)));
static fractcomplex factors[BLOCK / 2] __attribute__((space(xmemory)));
static fractional delay[TAPS] __attribute__((space(ymemory), aligned(64)));
static fractcomplex spectrum[BLOCK] __attribute__((space(ymemory), aligned(512)));
static FIRStruct low_pass;

/* Interrupt: 12-bit counts around 0 become fractions below a quarter, so that the transform cannot overflow. */
static uint16 collect(uint8 microphone, sint16 sample, uint16 so_far)
{
    (void)so_far;
    if (microphone == 0) {
        heard[writing][filled] = sample * 4;
        if (++filled == BLOCK) {
            filled = 0;
            writing ^= 1;
        }
    }
    return 0;
}

/* Fractions of sin(pi x) / (pi x) for the ideal low-pass, by the recurrence of the Chebyshev polynomials. */
static void design(void)
{
    fractional taper[TAPS];
    HammingInit(TAPS, taper);
    float turn = 3.14159265f * CUTOFF_HZ / SAMPLES_HZ; /* half a sample */
    float sine = turn - turn * turn * turn / 6 + turn * turn * turn * turn * turn / 120;
    float twice_cosine = 2 * (1 - 2 * sine * sine); /* of a whole sample */
    float before = -sine;
    float now = sine;
    for (int i = 0; i < TAPS / 2; i++) {
        fractional tap = Float2Fract(now / (3.14159265f * ((float)i + 0.5f)));
        coefficients[TAPS / 2 + i] = coefficients[TAPS / 2 - 1 - i] = tap;
        float next = twice_cosine * now - before;
        before = now;
        now = next;
    }
    VectorWindow(TAPS, coefficients, coefficients, taper);
    FIRStructInit(&low_pass, TAPS, coefficients, COEFFS_IN_DATA, delay);
    FIRDelayInit(&low_pass);
    HanningInit(BLOCK, window);
    TwidFactorInit(LOG2_BLOCK, factors, 0);
}

static void listen(void *unused)
{
    (void)unused;
    design();
    for (uint16 reading = writing;;) {
        while (reading == writing) {
            Sys_Sleep(5);
        }
        fractional *block = heard[reading];
        FIR(BLOCK, block, block, &low_pass);
        VectorMultiply(BLOCK, block, block, window);
        for (uint16 i = 0; i < BLOCK; i++) {
            spectrum[i].real = block[i];
            spectrum[i].imag = 0;
        }
        reading ^= 1;
        FFTComplexIP(LOG2_BLOCK, spectrum, factors, COEFFS_IN_DATA);
        BitReverseComplex(LOG2_BLOCK, spectrum);
        VectorScale(2 * BLOCK, &spectrum[0].real, &spectrum[0].real, Q15(0.999));
        fractional *power = block; /* the input is real, so half of the spectrum is enough */
        for (uint16 i = 0; i < BLOCK / 2; i++) {
            spectrum[i].real *= 16;
            spectrum[i].imag *= 16;
        }
        SquareMagnitudeCplx(BLOCK / 2, spectrum, power);
        int strongest;
        fractional most = VectorMax(BLOCK / 2, power, &strongest);
        char message[24];
        if (most < 64) {
            strcpy(message, "silence\r\n");
        } else {
            snprintf(message, sizeof message, "%u Hz\r\n", (uint16)strongest * (SAMPLES_HZ / BLOCK));
        }
        Sys_Send_Event(SYS_SEND_UART1, message, (uint16)strlen(message));
    }
}

int main(void)
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Analog());
    Sys_Set_SoundProcessor(collect);
    const sys_process_config listener = {.entry = listen, .stack = STACK, .flags = SYS_DSP};
    SYS_ASSERT(Sys_Start_ProcessWith(&listener) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
