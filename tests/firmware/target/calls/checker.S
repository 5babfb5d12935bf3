; The thread whose registers are checked, and the injected interrupt.
#include "../checker.inc"

        isr     __INT1Interrupt, _calls_isr

; As a camera's interrupt (IPL 6): calls nothing, pushes nothing.
        .global __INT2Interrupt
__INT2Interrupt:
        push.s
        bclr    IFS1, #7                ; INT2IF (dspic30f6014a.md §5)
        inc     _leaf
        pop.s
        retfie
