; SPDX-License-Identifier: MIT
; dsp.h: fast Fourier transforms of N = 2^log2n complex Q15 values {real, imag}, decimation in frequency, each stage halved:
; the result is 1/N of the sum. The data are in Y RAM, the factors in X RAM or program memory.

        .include "dsp.inc"

        ; W5:W4 = b, W10 at a: a becomes (a+b)/2, W5:W4 (a-b)/2 = (a+b)/2 - b
        .macro  halves
        lac     [w10],#1,A
        add     w4,#1,A
        sac.r   A,w0
        mov     w0,[w10++]
        sub     w0,w4,w4
        lac     [w10],#1,A
        add     w5,#1,A
        sac.r   A,w0
        mov     w0,[w10++]
        sub     w0,w5,w5
        .endm

; fractcomplex *FFTComplexIP(int log2n, fractcomplex *data, fractcomplex *factors, int page): result in bit-reversed order.
; A butterfly makes (a+b)/2 and ((a-b)/2) * W in 16 cycles; the last stage, where W is 1, in 14.
        .section .text._FFTComplexIP,code
        .global _FFTComplexIP
_FFTComplexIP:
        pushall
        mov     w14,[w15++]
        mov     w1,[w15++]
        fractional w4
        paged   w3,w4
        mov     #1,w3
        sl      w3,w0,w3                ; N
        sl      w3,#2,w14
        add     w1,w14,w14              ; end of the data
        sl      w3,w9                   ; bytes from the upper to the lower half of a group
        lsr     w3,w3
        dec     w3,w3                   ; number of butterflies of a group minus 1
        mov     #4,w12                  ; bytes from factor to factor
        bra     z,5f
1:      mov     w1,w13
2:      mov     w2,w8
        mov     w13,w10                 ; upper half
        add     w10,w9,w11              ; read pointer and write pointer of the lower half
        mov     w11,w13
        movsac  A,[w8]+=2,w6,[w11]+=2,w4
        movsac  A,[w8],w7,[w11]+=2,w5
        add     w8,w12,w8               ; at the imaginary part of the next factor
        dec     w3,w0
        do      w0,3f
        halves
        mpy     w4*w6,B
        msc     w5*w7,B
        mpy     w4*w7,A,[w8]-=2,w7,[w11]+=2,w4
        mac     w5*w6,A,[w8]+=2,w6,[w11]+=2,w5,[w13]+=2
        sac.r   A,[w13++]
3:      add     w8,w12,w8
        halves                          ; the last butterfly, without prefetch
        mpy     w4*w6,B
        msc     w5*w7,B
        mpy     w4*w7,A
        mac     w5*w6,A,[w13]+=2
        sac.r   A,[w13++]
        cp      w13,w14
        bra     nz,2b
        lsr     w9,w9
        sl      w12,w12
        lsr     w3,w3
        bra     nz,1b
5:      mov     w1,w10
        sub     w14,w1,w3
        lsr     w3,#3,w3
        dec     w3,w3
        do      w3,6f
        mov     [w10+4],w4
        mov     [w10+6],w5
        halves
        mov     w4,[w10++]
6:      mov     w5,[w10++]
        pop     _PSVPAG
        pop     _CORCON
        mov     [--w15],w0
        mov     [--w15],w14
        popall
        return

; fractcomplex *BitReverseComplex(int log2n, fractcomplex *data). From i-1 to i, the bits up to the lowest 1 of i change; in
; the reversed number these are the high bits. Bit-reversed addressing is not used: it would affect interrupt handlers.
        .section .text._BitReverseComplex,code
        .global _BitReverseComplex
_BitReverseComplex:
        mov     #1,w2
        sl      w2,w0,w2
        sub     w2,#2,w5
        inc     w5,w2                   ; N-1
        mov     w1,[w15++]
        clr     w3                      ; i
        clr     w4                      ; i reversed
        do      w5,1f
        inc     w3,w3
        ff1r    w3,w5
        lsr     w2,w5,w5
        xor     w2,w5,w5
        xor     w4,w5,w4
        cp      w3,w4
        bra     geu,1f
        sl      w3,#2,w6
        add     w6,w1,w6
        sl      w4,#2,w7
        add     w7,w1,w7
        mov     [w6],w5
        mov     [w7],w0
        mov     w0,[w6++]
        mov     w5,[w7++]
        mov     [w6],w5
        mov     [w7],w0
        mov     w0,[w6]
        mov     w5,[w7]
1:      nop
        mov     [--w15],w0
        return

; fractcomplex *FFTComplex(int log2n, fractcomplex *dst, fractcomplex *src, fractcomplex *factors, int page), from natural
; to natural order. IFFTComplex is the same with conjugate factors from the caller.
        .section .text._FFTComplex,code
        .global _FFTComplex
        .global _IFFTComplex
_FFTComplex:
_IFFTComplex:
        mov     #2,w5
        sl      w5,w0,w5
        dec     w5,w5
        mov     w1,w6
        repeat  w5
        mov     [w2++],[w6++]
        mov     w3,w2
        mov     w4,w3
        mov.d   w0,[w15++]
        rcall   _FFTComplexIP
        mov.d   [--w15],w0
        bra     _BitReverseComplex

; fractcomplex *IFFTComplexIP(int log2n, fractcomplex *data, fractcomplex *factors, int page): from bit-reversed to natural
; order
        .section .text._IFFTComplexIP,code
        .global _IFFTComplexIP
_IFFTComplexIP:
        mov.d   w0,[w15++]
        mov.d   w2,[w15++]
        rcall   _BitReverseComplex
        mov.d   [--w15],w2
        sub     w15,#4,w15
        mov.d   [w15++],w0
        rcall   _FFTComplexIP
        mov.d   [--w15],w0
        bra     _BitReverseComplex

; fractional *SquareMagnitudeCplx(int n, fractcomplex *src, fractional *dst), src in Y RAM: 3 cycles an element
        .section .text._SquareMagnitudeCplx,code
        .global _SquareMagnitudeCplx
_SquareMagnitudeCplx:
        mov     w10,[w15++]
        fractional w3
        sub     w0,#2,w3
        mov     w1,w10
        mov     w2,w0
        movsac  A,[w10]+=2,w4
        bra     n,2f
        do      w3,1f
        mpy     w4*w4,A,[w10]+=2,w5
        mac     w5*w5,A,[w10]+=2,w4
1:      sac.r   A,[w2++]
2:      mpy     w4*w4,A,[w10]+=2,w5     ; the last element, without prefetch
        mac     w5*w5,A
        sac.r   A,[w2++]
        pop     _CORCON
        mov     [--w15],w10
        return
