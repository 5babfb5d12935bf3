/* SPDX-License-Identifier: MIT */
/* LEDs: no events, direct access. */
#include "io.h"
#include "kernel.h"

bool Sys_Set_LED(uint8 led, bool on)
{
    if (led >= SYS_LEDS) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    hal_lock_state lock = hal_lock_devices();
    hal_led_set(led, on);
    hal_unlock(lock);
    return true;
}

bool Sys_Toggle_LED(uint8 led)
{
    if (led >= SYS_LEDS) {
        return os_fail(SYS_ERROR_ARGUMENT);
    }
    hal_lock_state lock = hal_lock_devices();
    hal_led_set(led, !hal_led_get(led));
    hal_unlock(lock);
    return true;
}
