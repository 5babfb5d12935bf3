/* SPDX-License-Identifier: MIT */
; Motor tick, 9,600 Hz, IPL 5: advances both step fractions and drives the coils. Calls nothing, masks nothing and
; stays on the interrupted stack (12 bytes with the hardware frame). Fields of stepper (motors.c): rate 0, fraction
; 2, phases 4, coils 6.
        .equ    FULL_STEP, 6192
        .equ    T3IF, 7                 ; IFS0

        .macro  advance motor
        mov     \motor+2, w0
        add     \motor, WREG            ; fraction + rate
        bra     n, 1f
        mov     #FULL_STEP, w1
        sub     w0, w1, w1
        bra     n, 2f                   ; no step due
        mov     w1, w0
        mov     \motor+4, w1            ; next index
        rrnc    w1, w1
        rrnc    w1, w1
        rrnc    w1, w1
        rrnc    w1, w1
        mov     w1, \motor+4
        bra     2f
1:      mov     #FULL_STEP, w1
        add     w0, w1, w0
        mov     \motor+4, w1            ; previous index
        rlnc    w1, w1
        rlnc    w1, w1
        rlnc    w1, w1
        rlnc    w1, w1
        mov     w1, \motor+4
2:      mov     w0, \motor+2
        .endm

        .text
        .global __T3Interrupt
__T3Interrupt:
        push.d  w0
        push    w2
        advance _stepper_left
        advance _stepper_right
        mov     _stepper_right+4, w0
        and     _stepper_right+6, WREG
        sl      w0, #4, w2
        mov     _stepper_left+4, w0
        and     _stepper_left+6, WREG
        ior     w0, w2, w0
        mov.b   WREG, LATD
        bclr    IFS0, #T3IF             ; last: a trap on the way abandons this tick, not the next
        pop     w2
        pop.d   w0
        retfie
