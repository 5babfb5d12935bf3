/* SPDX-License-Identifier: MIT */
/* Emitter, comparator and strength of the Kilobot's infrared. Times are counts of T1 (1 us at 8 MHz) and wrap. All in
 * ISR context unless stated. */
#ifndef PULSES_H
#define PULSES_H

#include "openswarm.h"

void pulses_prepare(uint16 first_alarm); /* sets up pins, noise and first alarm; before the kernel starts */
void pulses_listen(void);                /* enables the interrupt of pulses */
uint16 pulses_noise(void);               /* random bits measured by pulses_prepare() */

uint16 pulses_now(void);
uint16 pulses_seen(void);               /* start of the last pulse, captured by hardware and so always exact */
void pulses_alarm(uint16 counts);       /* calls infrared_alarm_isr() after `counts` */
void pulses_alarm_again(uint16 counts); /* calls it `counts` after the last alarm */

void pulses_emitter(bool is_output);
void pulses_flash(void); /* a one: 1.1 us of light */

enum {
    PULSES_SATURATED = 900, /* counts of high gain; stronger pulses use low gain, encoded above the next number */
    PULSES_LOW_GAIN = 1024
};
void pulses_gain(bool is_high); /* for the following pulses */
uint16 pulses_strength(void);   /* 0-1023 of one of the last two pulses */

#endif
