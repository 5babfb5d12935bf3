; INT1 at IPL 4: the test sets its flag.
#include "hal_limits.h"
#include "isr.inc"
        .text
        isr     __INT1Interrupt, acknowledge
acknowledge:
        bclr    IFS1, #0
        bra     _from_interrupt
