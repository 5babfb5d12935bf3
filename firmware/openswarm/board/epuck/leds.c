/* LEDs and selector of the e-puck. */
#include "io.h"
#include "pins.h"

static const uint16 ring[SYS_LED_RING] = PIN_LED_RING;

void hal_led_init(void)
{
}

void hal_led_set(uint8_t led, bool on)
{
    volatile unsigned int *latch = led < SYS_LED_RING ? &LATA : &LATC;
    uint16 pin = led < SYS_LED_RING ? ring[led] : led == SYS_LED_BODY ? PIN_BODY_LED : PIN_FRONT_LED;
    if (on) {
        *latch |= pin;
    } else {
        *latch &= (uint16)~pin;
    }
}

bool hal_led_get(uint8_t led)
{
    if (led < SYS_LED_RING) {
        return (LATA & ring[led]) != 0;
    }
    return (LATC & (led == SYS_LED_BODY ? PIN_BODY_LED : PIN_FRONT_LED)) != 0;
}

void hal_selector_init(void)
{
}

uint8_t hal_selector_read(void)
{
    return (uint8)(PORTG >> PIN_SELECTOR_SHIFT & 15u);
}
