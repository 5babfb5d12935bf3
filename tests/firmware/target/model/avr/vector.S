#define __SFR_OFFSET 0
#include <avr/io.h>
#include "isr.inc"
        .text
        isr     INT0_vect, boundaries_isr
