/* SPDX-License-Identifier: MIT */
; Interrupt entries of the Kilobot's devices (port/avr/isr.inc).
#define __SFR_OFFSET 0
#include <avr/io.h>
#include "isr.inc"
        .text
        isr     USART_UDRE_vect, uart_empty_isr
        isr     USART_RX_vect, uart_received_isr
