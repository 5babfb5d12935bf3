/* SPDX-License-Identifier: MIT */
; Interrupt entries of the board's devices; isr.inc is the port's.
#include "hal_limits.h"
#include "isr.inc"
        .text
        .global __U1TXInterrupt, __U2RXInterrupt, __U2TXInterrupt
__U1TXInterrupt:
__U2RXInterrupt:
__U2TXInterrupt:
        isr     __U1RXInterrupt, _uart_isr
