; Entry of the remote control's interrupt.
#include "isr.inc"
        .text
        isr     __INT0Interrupt, _remote_isr
