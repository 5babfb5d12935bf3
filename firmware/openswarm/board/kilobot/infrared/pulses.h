/* SPDX-License-Identifier: MIT */
/* Emitter, comparator and strength of the Kilobot's infrared. Times are counts of T1 (1 us at 8 MHz) and wrap. All in
 * ISR context unless said. */
#ifndef PULSES_H
#define PULSES_H

#include "openswarm.h"

void pulses_prepare(uint16 first_alarm); /* pins and noise; before the kernel starts. No interrupt comes before that */
void pulses_listen(void);                /* from now on a pulse interrupts */
uint16 pulses_noise(void);               /* of the start */

uint16 pulses_now(void);
uint16 pulses_seen(void);               /* when the last pulse began, in hardware: exact however late it is asked */
void pulses_alarm(uint16 counts);       /* infrared_alarm_isr comes that much later */
void pulses_alarm_again(uint16 counts); /* or so much after the last one */

void pulses_emitter(bool is_output);
void pulses_flash(void); /* a one: 1.1 us of light */

enum {
    PULSES_SATURATED = 900, /* counts of high gain; stronger pulses use low gain, encoded above the next number */
    PULSES_LOW_GAIN = 1024
};
void pulses_gain(bool is_high); /* of the pulses to come */
uint16 pulses_strength(void);   /* 0-1023 of one of the last two pulses */

#endif
