/* SPDX-License-Identifier: MIT */
/* LEDs: orders through a post-processor to the lower layer. */
#include "kernel.h"
#include "led.h"
#include "openswarm_io.h"

#include <string.h>

static sys_led_processor processor; /* NULL: orders unchanged */

static void carry_out(uint8 led, uint8 action)
{
    if (action == SYS_LED_TOGGLE) {
        (void)Sys_Toggle_LED(led);
    } else {
        (void)Sys_Set_LED(led, action == SYS_LED_ON);
    }
}

static bool on_order(uint16 pid, uint16 event, sys_event_data *data)
{
    sys_led_order order;
    (void)pid;
    (void)event;
    if (data->size < sizeof order) {
        return true;
    }
    memcpy(&order, data->payload, sizeof order);
    if (processor != NULL && !processor(&order)) {
        return true;
    }
    if (order.led != SYS_LED_ALL) {
        carry_out(order.led, order.action);
        return true;
    }
    for (uint8 led = 0; led < SYS_LEDS; led++) {
        carry_out(led, order.action);
    }
    return true;
}

sys_led_processor Sys_Set_LEDProcessor(sys_led_processor wanted)
{
    hal_lock_state lock = hal_lock_slice();
    sys_led_processor before = processor;
    processor = wanted;
    hal_unlock(lock);
    return before;
}

bool Sys_Start_LEDs(void)
{
    processor = NULL;
    return Sys_Register_Event(SYS_IO_LED) && event_connect(SYS_IO_LED, on_order);
}
