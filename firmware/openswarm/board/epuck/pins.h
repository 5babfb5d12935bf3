/* SPDX-License-Identifier: MIT */
/* Pins of the e-puck, version 1 (epuck.md §2). */
#ifndef PINS_H
#define PINS_H

#include <p30F6014A.h>

/* Ring LEDs 0-7, clockwise from the front, are RA6 RA7 RA9 RA12 RA10 RA13 RA14 RA15. */
#define PIN_LED_RING 1u << 6, 1u << 7, 1u << 9, 1u << 12, 1u << 10, 1u << 13, 1u << 14, 1u << 15
#define PIN_LED_RING_ALL 0xF6C0u
#define PIN_FRONT_LED 0x0002u  /* RC1 */
#define PIN_BODY_LED 0x0004u   /* RC2 */
#define PIN_CAMERA_RESET 0x2000u /* RC13 */
#define PIN_MOTORS 0x00FFu     /* RD0-3 left, RD4-7 right */
#define PIN_PULSE_IR_F 0x0180u /* RF7, RF8 */
#define PIN_PULSE_IR_G 0x0003u /* RG0, RG1 */
#define PIN_DEBUGGER 0x0003u   /* AN0, AN1; the other inputs of port B are analog */
#define PIN_AUDIO_ON 0x0001u   /* RF0 */
#define PIN_I2C 0x000Cu        /* RG2 SCL, RG3 SDA */
#define PIN_SELECTOR_SHIFT 6   /* RG6-RG9 */

#endif
