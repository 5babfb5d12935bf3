; SPDX-License-Identifier: MIT
; dsp.h: IIR filters. Coefficients are half of those of the difference equation, so that they fit Q15; sums are doubled
; when they are stored.

        .include "dsp.inc"

; void IIRCanonicInit(IIRCanonicStruct *), void IIRTransposedInit(IIRTransposedStruct *), IIRLatticeInit
        .section .text._IIRCanonicInit,code
        .global _IIRCanonicInit
_IIRCanonicInit:
        mov     [w0],w1
        mov     [w0+6],w2
        add     w1,w1,w1
        inc     w1,w1
        repeat  w1
        clr     [w2++]
        return

        .section .text._IIRTransposedInit,code
        .global _IIRTransposedInit
_IIRTransposedInit:
        mov     [w0],w1
        mov     [w0+6],w2
        repeat  w1
        clr     [w2++]
        mov     [w0+8],w2
        repeat  w1
        clr     [w2++]
        return

        .section .text._IIRLatticeInit,code
        .global _IIRLatticeInit
_IIRLatticeInit:
        mov     [w0],w1
        mov     [w0+8],w2
        repeat  w1
        clr     [w2++]
        return

; fractional *IIRCanonic(int n, fractional *dst, fractional *src, IIRCanonicStruct *filter): direct form II.
; {int sections less 1; coeffsBase {a2, a1, b2, b1, b0}; int coeffsPage; delayBase {w[-2], w[-1]}, in Y; int initialGain,
; finalShift}. The accumulator passes the sum from section to section. 9 cycles per section.
        .section .text._IIRCanonic,code
        .global _IIRCanonic
_IIRCanonic:
        pushall
        mov     w1,[w15++]
        fractional w4
        mov     [w3+4],w5
        paged   w5,w4
        mov     [w3++],w12              ; sections minus 1
        mov     [w3++],w11              ; coefficients
        inc2    w3,w3
        mov     [w3++],w13              ; delay
        mov     [w3++],w9               ; gain
        mov     [w3],w3
        neg     w3,w3                   ; sign of SFTAC: positive shifts right
        dec     w0,w0
1:      mov     w11,w8
        mov     w13,w10
        mov     [w2++],w4
        mov     w9,w5
        mpy     w4*w5,A,[w8]+=2,w4
        do      w12,2f
        mov     [w10++],w5
        mac     w4*w5,A,[w8]+=2,w4,[w10]-=2,w6
        mac     w4*w6,A,[w8]+=2,w4
        sac.r   A,#-1,w7
        mpy     w4*w5,A,[w8]+=2,w4
        mac     w4*w6,A,[w8]+=2,w4
        mov     w6,[w10++]
        mov     w7,[w10++]
2:      mac     w4*w7,A,[w8]+=2,w4
        sftac   A,w3
        sac.r   A,#-1,[w1++]
        dec     w0,w0
        bra     nn,1b
        finished

; fractional *IIRTransposed(int n, fractional *dst, fractional *src, IIRTransposedStruct *filter): transposed form II.
; {int sections less 1; coeffsBase {b0, b1, a1, b2, a2}; int coeffsPage; delayBase1, delayBase2, 1 word per section; int
; finalShift}. 11 cycles per section.
        .section .text._IIRTransposed,code
        .global _IIRTransposed
_IIRTransposed:
        pushall
        mov     w1,[w15++]
        fractional w4
        mov     [w3+4],w5
        paged   w5,w4
        mov     [w3++],w12
        mov     [w3++],w9
        inc2    w3,w3
        mov     [w3++],w5
        mov     [w3++],w13
        mov     [w3],w3
        neg     w3,w3
        dec     w0,w0
1:      mov     w9,w8
        mov     w5,w10
        mov     w13,w11
        mov     [w2++],w6
        mov     [w8++],w4
        do      w12,2f
        lac     [w10],#1,A
        mac     w4*w6,A,[w8]+=2,w4
        lac     [w11],#1,B
        mac     w4*w6,B,[w8]+=2,w4
        sac.r   A,#-1,w7                ; y of the section
        mac     w4*w7,B,[w8]+=2,w4
        sac.r   B,#-1,[w10++]
        mpy     w4*w6,B,[w8]+=2,w4
        mac     w4*w7,B,[w8]+=2,w4
        sac.r   B,#-1,[w11++]
2:      mov     w7,w6
        lac     w6,A
        sftac   A,w3
        sac.r   A,[w1++]
        dec     w0,w0
        bra     nn,1b
        finished

; fractional *IIRLattice(int n, fractional *dst, fractional *src, IIRLatticeStruct *filter)
; {int order M; kappaVals, gammaVals or 0; int coeffsPage; delay of M+1 words in Y}. From the last coefficient to the first:
; c -= kappa * delay[m+1]; delay[m] = delay[m+1] + kappa * c; then delay[M] = c; the result is c, or the sum of
; gamma[M-m] * delay[m].
        .section .text._IIRLattice,code
        .global _IIRLattice
_IIRLattice:
        pushall
        mov     w1,[w15++]
        fractional w4
        mov     [w3+6],w5
        paged   w5,w4
        mov     [w3],w12
        add     w12,w12,w6
        mov     [w3+2],w9
        add     w9,w6,w9
        dec2    w9,w9                   ; kappa[M-1]
        mov     [w3+4],w13
        cp0     w13
        bra     z,0f
        add     w13,w6,w13              ; gamma[M]
0:      mov     [w3+8],w11
        dec     w12,w12
        dec     w0,w0
1:      mov     w9,w8
        mov     w11,w10
        mov     [w2++],w7
        do      w12,2f
        mov     [w8--],w4
        mov     [w10+2],w6
        lac     w7,A
        msc     w4*w6,A
        sac.r   A,w7
        lac     w6,A
        mac     w4*w7,A
2:      sac.r   A,[w10++]
        mov     w7,[w10]
        cp0     w13
        bra     z,3f
        mov     w13,w8
        mov     w11,w10
        clr     A,[w8]-=2,w4,[w10]+=2,w5
        repeat  w12
        mac     w4*w5,A,[w8]-=2,w4,[w10]+=2,w5
        mac     w4*w5,A
        sac.r   A,w7
3:      mov     w7,[w1++]
        dec     w0,w0
        bra     nn,1b
        finished
