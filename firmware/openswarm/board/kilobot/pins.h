/* SPDX-License-Identifier: MIT */
/* Pins of the Kilobot as kilolib uses them. */
#ifndef PINS_H
#define PINS_H

#include <stdint.h>

/* LED: two bits of brightness a colour. The pins sink, with PORT 0, so the direction alone switches. */
#define PIN_RED_D 0x30u   /* PD5, PD4 */
#define PIN_GREEN_C 0x0Cu /* PC3, PC2 */
#define PIN_BLUE_C 0x30u  /* PC5, PC4 */
#define PIN_MOTOR_B 0x08u /* PB3 = OC2A, the first argument of kilolib's set_motors */
#define PIN_MOTOR_D 0x08u /* PD3 = OC2B, the second */

void kilobot_motors_tick(void); /* ISR, every 1 ms */

#endif
