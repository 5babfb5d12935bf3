        .text
        .global _overflow_by_push
_overflow_by_push:
1:      push.d  w0
        bra     1b

; Stops just below the limit, where only an interrupt's own frame overflows.
        .global _overflow_at_interrupt
_overflow_at_interrupt:
        mov     SPLIM, w0
        mov     w0, w15
1:      bra     1b
