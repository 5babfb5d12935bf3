; Interrupt entries of the board's devices; isr.inc is the port's.
#include "isr.inc"
        .text
        isr     __U1RXInterrupt, _uart1_receive_isr
        isr     __U1TXInterrupt, _uart1_transmit_isr
        isr     __U2RXInterrupt, _uart2_receive_isr
        isr     __U2TXInterrupt, _uart2_transmit_isr
