/* SPDX-License-Identifier: MIT */
/* LEDs and selector of the e-puck. */
#include "io.h"
#include "pins.h"

static const uint16 pins[SYS_LEDS] = {PIN_LED_RING, PIN_BODY_LED, PIN_FRONT_LED};

static volatile unsigned int *latch_of(uint8 led)
{
    return led < SYS_LED_RING ? &LATA : &LATC;
}

void hal_led_init(void)
{
}

void hal_led_set(uint8_t led, bool on)
{
    uint16 lit = *latch_of(led) | pins[led];
    *latch_of(led) = on ? lit : lit ^ pins[led];
}

bool hal_led_get(uint8_t led)
{
    return (*latch_of(led) & pins[led]) != 0;
}

void hal_selector_init(void)
{
}

uint8_t hal_selector_read(void)
{
    return (uint8)(PORTG >> PIN_SELECTOR_SHIFT & 15u);
}
