; INT1 at IPL 4 for measurements: set IFS1.INT1IF from outside.
#include "isr.inc"
        .text
        isr     __INT1Interrupt, _latency_isr
