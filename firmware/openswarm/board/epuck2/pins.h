/* SPDX-License-Identifier: MIT */
/* Pins of the e-puck2 as its stock firmware uses them. */
#ifndef PINS_H
#define PINS_H

#include <stdint.h>

#define PIN_LED_RING_D (1u << 5 | 1u << 6 | 1u << 10 | 1u << 11) /* LED1, 3, 5, 7: low = on */
#define PIN_FRONT_LED_D (1u << 14)                               /* high = on */
#define PIN_BODY_LED_B (1u << 2)                                 /* high = on */
#define PIN_MOTORS_E 0xFF00u                                     /* PE8-11 left, PE12-15 right */
/* selector: PC13, PC14, PC15 bits 0-2, PD4 bit 3; USART3: PD8 out, PD9 in */

enum { PINS_OUTPUT = 1, PINS_ALTERNATE = 2 };
void pins_set_mode(uint32_t port, uint32_t pins, uint32_t mode); /* GPIO_B..GPIO_E */

#endif
