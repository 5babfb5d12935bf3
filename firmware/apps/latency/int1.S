; INT1 at IPL 4 for measurements: set IFS1.INT1IF from outside. Its flag is cleared before the C function runs.
#include "hal_limits.h"
#include "isr.inc"
        .text
        isr     __INT1Interrupt, acknowledge
acknowledge:
        bclr    IFS1, #0
        bra     _latency_isr
