/* SPDX-License-Identifier: MIT */
/* The Kilobot's one LED as three: 0 red, 1 green, 2 blue; SYS_LED_BODY is all of them. Other numbers are dark. */
#include "io.h"
#include "pins.h"

#include <avr/io.h>

enum { RED_LED, GREEN_LED, BLUE_LED };

static uint8 pins_d(uint8 led)
{
    return led == RED_LED || led == SYS_LED_BODY ? PIN_RED_D : 0;
}

static uint8 pins_c(uint8 led)
{
    return led == GREEN_LED      ? PIN_GREEN_C
           : led == BLUE_LED     ? PIN_BLUE_C
           : led == SYS_LED_BODY ? PIN_GREEN_C | PIN_BLUE_C
                                 : 0;
}

void hal_led_init(void)
{
    PORTC &= (uint8)~(PIN_GREEN_C | PIN_BLUE_C);
    PORTD &= (uint8)~PIN_RED_D;
}

void hal_led_set(uint8_t led, bool on)
{
    DDRC = on ? DDRC | pins_c(led) : DDRC & (uint8)~pins_c(led);
    DDRD = on ? DDRD | pins_d(led) : DDRD & (uint8)~pins_d(led);
}

bool hal_led_get(uint8_t led)
{
    return (DDRC & pins_c(led)) != 0 || (DDRD & pins_d(led)) != 0;
}
