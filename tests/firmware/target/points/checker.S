; A thread that fills its registers, lets two rounds of a loop pass and checks them, then yields.
#include "hal_limits.h"
#include "isr.inc"
        .text
        .global _pattern_checker
_pattern_checker:
1:      mov     #0x1111, w1
        mov     #0x2222, w2
        mov     #0x3333, w3
        mov     #0x4444, w4
        mov     #0x5555, w5
        mov     #0x6666, w6
        mov     #0x7777, w7
        mov     #0x8888, w8
        mov     #0x9999, w9
        mov     #0xAAAA, w10
        mov     #0xBBBB, w11
        mov     #0xCCCC, w12
        mov     #0xDDDD, w13
        mov     #0xEEEE, w14
        clr     w0
        repeat  #5
        inc     w0, w0
        sub     #6, w0
        bra     nz, 9f
        mov     #0x1111, w0
        sub     w1, w0, w1
        ior     w1, w1, w1
        bra     nz, 9f
        sub     w2, w0, w2
        sub     w2, w0, w2
        bra     nz, 9f
        sub     w14, w13, w14
        sub     w14, w0, w14
        bra     nz, 9f
        add     w3, w12, w3
        inc     w3, w3
        bra     nz, 9f
        add     w4, w11, w4
        inc     w4, w4
        bra     nz, 9f
        add     w5, w10, w5
        inc     w5, w5
        bra     nz, 9f
        add     w6, w9, w6
        inc     w6, w6
        bra     nz, 9f
        add     w7, w8, w7
        inc     w7, w7
        bra     nz, 9f
        inc     _checked
        rcall   _checker_yield
        bra     1b
9:      mov     #1, w0
        mov     w0, _broken
        bra     1b

        isr     __INT1Interrupt, _points_isr
