#include "hal_limits.h"
#include "isr.inc"
        .text
        isr     __INT1Interrupt, _bugs_isr
