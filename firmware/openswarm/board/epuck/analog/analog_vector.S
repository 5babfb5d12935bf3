; Entry of the converter's interrupt.
#include "isr.inc"
        .text
        isr     __ADCInterrupt, _analog_isr
