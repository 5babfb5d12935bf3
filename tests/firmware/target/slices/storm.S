; 100 us device: T4 at IPL 4 sends an event from C.
#include "hal_limits.h"
#include "isr.inc"
        .text
        isr     __T4Interrupt, _storm_isr
