/* SPDX-License-Identifier: MIT */
/* Stepper motors of the e-puck2 in half-steps, from TIM4 at 9,600 Hz, above level device: it never calls the kernel.
 *
 * As on the e-puck 1000 steps are a turn of the wheel and 129 mm/s are 1000 steps/s, that is 2000 half-steps: each
 * tick adds 10 v to a fraction of 6192, and a half-step is due whenever it leaves 0..6191. No rounding. The order of
 * the coils is UNVERIFIED on a robot. */
#include "io.h"
#include "kernel.h"
#include "pins.h"
#include "stm32f407.h"

enum { TICK_COUNTS = 84000000 / 9600, PER_MM_S = 10, WHOLE = 6192, PHASES = 8, PRIORITY = 0x40, LEFT_SHIFT = 8 };

static const uint8 coils[PHASES] = {0x5, 0x1, 0x9, 0x8, 0xA, 0x2, 0x6, 0x4}; /* IN1..IN4 */

typedef struct {
    volatile sint16 rate;
    sint16 fraction;
    uint8 phase;
    sint32 half_steps;
} stepper;

stepper stepper_left, stepper_right;

void hal_motors_init(void)
{
    RCC_APB1ENR |= RCC_APB1ENR_TIM4;
    (void)RCC_APB1ENR; /* two cycles until it answers (RM0090, RCC) */
    TIM4_PSC = 0;
    TIM4_ARR = TICK_COUNTS - 1;
    NVIC_IPR(IRQ_TIM4) = PRIORITY;
    hal_motors_drive(0, 0);
}

static void advance(stepper *s)
{
    sint16 fraction = (sint16)(s->fraction + s->rate);
    if (fraction >= WHOLE) {
        fraction = (sint16)(fraction - WHOLE);
        s->phase = (uint8)((s->phase + 1u) % PHASES);
        s->half_steps++;
    } else if (fraction < 0) {
        fraction = (sint16)(fraction + WHOLE);
        s->phase = (uint8)((s->phase - 1u) % PHASES);
        s->half_steps--;
    }
    s->fraction = fraction;
}

static uint32_t nibble(const stepper *s)
{
    return s->rate != 0 ? coils[s->phase] : 0;
}

HAL_USED void TIM4_Handler(void)
{
    TIM4_SR = 0;
    advance(&stepper_left);
    advance(&stepper_right);
    uint32_t on = (nibble(&stepper_left) | nibble(&stepper_right) << 4) << LEFT_SHIFT;
    GPIO_BSRR(GPIO_E) = on | (PIN_MOTORS_E & ~on) << 16;
    (void)TIM4_SR; /* the flag is clear before the return */
}

void hal_motors_drive(int16_t left_mm_s, int16_t right_mm_s)
{
    stepper_left.rate = (sint16)(-left_mm_s * PER_MM_S);
    stepper_right.rate = (sint16)(right_mm_s * PER_MM_S);
    if (left_mm_s == 0 && right_mm_s == 0) {
        TIM4_CR1 = 0;
        TIM4_DIER = 0;
        GPIO_BSRR(GPIO_E) = PIN_MOTORS_E << 16;
    } else {
        TIM4_DIER = 1;
        TIM4_CR1 = 1;
        NVIC_ISER(IRQ_TIM4) = NVIC_BIT(IRQ_TIM4);
    }
}
