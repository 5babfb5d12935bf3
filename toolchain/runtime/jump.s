; SPDX-License-Identifier: MIT
; setjmp and longjmp (C11 7.13): buffer = W8..W13, W14, W15 after the return, return address low, high.

        .section .text._setjmp,code
        .global _setjmp
_setjmp:
        mov.d   w8,[w0++]
        mov.d   w10,[w0++]
        mov.d   w12,[w0++]
        mov     w14,[w0++]
        mov     [w15-4],w1
        mov     [w15-2],w2
        sub     w15,#4,w3
        mov     w3,[w0++]
        mov     w1,[w0++]
        mov     w2,[w0]
        retlw   #0,w0

        .section .text._longjmp,code
        .global _longjmp
_longjmp:
        mov.d   [w0++],w8
        mov.d   [w0++],w10
        mov.d   [w0++],w12
        mov     [w0++],w14
        mov     [w0++],w15
        mov     [w0++],w2
        mov     [w0],w3
        mov     w2,[w15++]
        mov     w3,[w15++]
        cp0     w1
        bra     nz,1f
        mov     #1,w1                   ; setjmp must not return 0 after longjmp
1:      mov     w1,w0
        return
