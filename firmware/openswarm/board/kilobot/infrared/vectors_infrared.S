/* SPDX-License-Identifier: MIT */
; Interrupt entries of the Kilobot's infrared (port/avr/isr.inc).
#define __SFR_OFFSET 0
#include <avr/io.h>
#include "isr.inc"
        .text
        isr     TIMER1_CAPT_vect, infrared_pulse_isr
        isr     TIMER1_COMPA_vect, infrared_alarm_isr
