/* SPDX-License-Identifier: MIT */
/* LEDs and selector of the e-puck2. LEDs 1, 3, 5, 7 of the ring are coloured and belong to the radio's CPU: dark
 * here. */
#include "io.h"
#include "pins.h"
#include "stm32f407.h"

static const uint8 ring_pins[4] = {5, 6, 10, 11};
static uint16 lit; /* requested state: the simulated ports cannot be read back */

static void put(uint32_t port, uint32_t pin, bool high)
{
    GPIO_BSRR(port) = high ? pin : pin << 16;
}

void hal_led_init(void)
{
    lit = 0;
}

void hal_led_set(uint8_t led, bool on)
{
    lit = (uint16)(on ? lit | 1u << led : lit & ~(1u << led));
    if (led == SYS_LED_BODY) {
        put(GPIO_B, PIN_BODY_LED_B, on);
    } else if (led == SYS_LED_FRONT) {
        put(GPIO_D, PIN_FRONT_LED_D, on);
    } else if (led % 2 == 0) {
        put(GPIO_D, 1u << ring_pins[led / 2], !on);
    }
}

bool hal_led_get(uint8_t led)
{
    return lit >> led & 1u;
}

void hal_selector_init(void)
{
}

uint8_t hal_selector_read(void)
{
    return (uint8)((GPIO_IDR(GPIO_C) >> 13 & 7u) | (GPIO_IDR(GPIO_D) >> 4 & 1u) << 3);
}
