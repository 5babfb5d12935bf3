/* SPDX-License-Identifier: MIT */
/* LEDs by event: SYS_IO_LED. Sys_Set_LED and Sys_Toggle_LED (openswarm_io.h) access them directly. */
#ifndef LED_H
#define LED_H

#include "openswarm.h"

enum {
    SYS_IO_LED = 0x14, /* [sys_led_order] request to switch a LED, from any sender */
    SYS_LED_ALL = 0xFF /* LED number that means all ten */
};

typedef enum { SYS_LED_OFF, SYS_LED_ON, SYS_LED_TOGGLE } sys_led_action;

typedef struct {
    uint8 led;    /* as in openswarm_io.h, or SYS_LED_ALL */
    uint8 action; /* a sys_led_action */
} sys_led_order;

/* Receives an order before its execution and may change it; false: the order is dropped. Handler context. */
typedef bool (*sys_led_processor)(sys_led_order *order);
/* MTH | no | 12 | 4 | none.  NULL: LED orders are executed unchanged. */
sys_led_processor Sys_Set_LEDProcessor(sys_led_processor processor);

/* M | no | - | 46 | MEMORY.  Between Sys_Init_Kernel and Sys_Start_Kernel. Columns: openswarm.h, top. */
bool Sys_Start_LEDs(void);

#endif
