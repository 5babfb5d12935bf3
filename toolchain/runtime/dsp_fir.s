; SPDX-License-Identifier: MIT
; dsp.h: FIR filters. A FIRStruct is {int numCoeffs; coeffsBase, coeffsEnd; int coeffsPage; delayBase, delayEnd, delay}.
; The delay is a circular buffer in Y RAM. Its pointer is at the oldest sample, which the next one replaces; older samples
; are above newer ones. Y modulo addressing affects only the Y reads of MAC. X modulo addressing is not used for the
; coefficients, because it would also change accesses through W8 in interrupt handlers.

        .include "dsp.inc"

; void FIRStructInit(FIRStruct *filter, int numCoeffs, fractional *coeffsBase, int coeffsPage, fractional *delayBase)
        .section .text._FIRStructInit,code
        .global _FIRStructInit
_FIRStructInit:
        add     w1,w1,w5
        dec     w5,w5
        mov     w1,[w0++]
        mov     w2,[w0++]
        add     w2,w5,[w0++]
        mov     w3,[w0++]
        mov     w4,[w0++]
        add     w4,w5,[w0++]
        mov     w4,[w0]
        return

; void FIRDelayInit(FIRStruct *filter): 11 + M
        .section .text._FIRDelayInit,code
        .global _FIRDelayInit
_FIRDelayInit:
        mov     [w0],w1
        mov     [w0+8],w2
        mov     w2,[w0+12]
        dec     w1,w1
        repeat  w1
        clr     [w2++]
        return

; void FIRInterpDelayInit(FIRStruct *filter, int rate): numCoeffs / rate words of delay
        .section .text._FIRInterpDelayInit,code
        .global _FIRInterpDelayInit
_FIRInterpDelayInit:
        mov     w0,w3
        mov     [w3],w2
        mov     w1,w4
        repeat  #17
        div.uw  w2,w4
        mov     [w3+8],w2
        mov     w2,[w3+12]
        dec     w0,w0
        repeat  w0
        clr     [w2++]
        return

; Common entry of the filters: W0 = samples minus 1, W9 = coefficients, W10 = delay pointer, circular in Y from delayBase to
; W5 bytes after it. Changes W4-W7.
        .macro  circular filter,bytes
        push    _MODCON
        push    _YMODSRT
        push    _YMODEND
        mov     [\filter+8],w4
        mov     w4,_YMODSRT
        add     w4,\bytes,w4
        dec     w4,w4
        mov     w4,_YMODEND
        mov     #0x40AF,w4              ; YMODEN, Y modulo for W10, none for X and bit reversal
        mov     w4,_MODCON
        .endm
        .macro  uncircular
        pop     _YMODEND
        pop     _YMODSRT
        pop     _MODCON
        .endm

; fractional *FIR(int n, fractional *dst, fractional *src, FIRStruct *filter): 1 cycle per tap and 5 per sample
        .section .text._FIR,code
        .global _FIR
_FIR:
        pushall
        mov     w1,[w15++]
        fractional w4
        mov     [w3+6],w5
        paged   w5,w4
        mov     [w3],w6
        add     w6,w6,w5
        circular w3,w5
        mov     [w3+2],w9
        mov     [w3+12],w10
        dec     w0,w0
        sub     w6,#3,w6                ; count of REPEAT: all taps except the first and the last two
        bra     n,2f
        do      w0,1f
        mov     w9,w8
        mov     [w2++],[w10]
        clr     A,[w8]+=2,w4,[w10]+=2,w5
        repeat  w6
        mac     w4*w5,A,[w8]+=2,w4,[w10]+=2,w5
        mac     w4*w5,A,[w8]+=2,w4,[w10],w5
        mac     w4*w5,A
1:      sac.r   A,[w1++]
        bra     6f
2:      btsc    w6,#0                   ; -1: two taps
        bra     4f
        mov     [w9],w4
        do      w0,3f
        mov     [w2++],w5
        mpy     w4*w5,A
3:      sac.r   A,[w1++]
        mov     w5,[w10]
        bra     6f
4:      do      w0,5f
        mov     w9,w8
        mov     [w2++],[w10]
        clr     A,[w8]+=2,w4,[w10]+=2,w5
        mac     w4*w5,A,[w8]+=2,w4,[w10],w5
        mac     w4*w5,A
5:      sac.r   A,[w1++]
6:      mov     w10,[w3+12]
        uncircular
        finished

; fractional *FIRDecimate(int n, fractional *dst, fractional *src, FIRStruct *filter, int rate): n outputs of n*rate inputs
        .section .text._FIRDecimate,code
        .global _FIRDecimate
_FIRDecimate:
        pushall
        mov     w1,[w15++]
        dec     w4,w12                  ; rate minus 1
        fractional w4
        mov     [w3+6],w5
        paged   w5,w4
        mov     [w3],w6
        add     w6,w6,w5
        circular w3,w5
        mov     [w3+2],w9
        mov     [w3+12],w10
        dec     w6,w6
        dec     w0,w0
1:      do      w12,2f
        mov     [w2++],[w10]
2:      movsac  A,[w10]-=2,w5           ; the oldest sample is below
        movsac  A,[w10]+=2,w5           ; the newest: W5 = the oldest, W10 at the newest
        mov     w9,w8
        clr     A,[w8]+=2,w4,[w10]+=2,w5
        repeat  w6
        mac     w4*w5,A,[w8]+=2,w4,[w10]+=2,w5
        movsac  A,[w10]-=2,w5           ; undo the last step, and from the newest to the oldest
        movsac  A,[w10]-=2,w5
        sac.r   A,[w1++]
        dec     w0,w0
        bra     nn,1b
        mov     w10,[w3+12]
        uncircular
        finished

; fractional *FIRInterpolate(int n, fractional *dst, fractional *src, FIRStruct *filter, int rate): n*rate outputs;
; output n*rate+r is the sum of h[r+k*rate] * sample n-k. 3 cycles per product.
        .section .text._FIRInterpolate,code
        .global _FIRInterpolate
_FIRInterpolate:
        pushall
        mov     w1,[w15++]
        mov     w0,w11                  ; samples
        mov     w4,w13                  ; rate
        fractional w4
        mov     [w3+6],w5
        paged   w5,w4
        mov     [w3],w6
        mov     w1,w7
        repeat  #17
        div.uw  w6,w13
        mov     w7,w1
        mov     w0,w6                   ; taps of each output
        add     w6,w6,w5
        circular w3,w5
        mov     [w3+12],w10
        add     w13,w13,w12             ; bytes between the coefficients of an output
        dec     w6,w6
        dec     w13,w13
1:      mov     [w2++],[w10]
        mov     [w3+2],w9
        do      w13,3f
        mov     w9,w8
        clr     A,[w10]+=2,w5
        do      w6,2f
        mov     [w8],w4
        add     w8,w12,w8
2:      mac     w4*w5,A,[w10]+=2,w5
        movsac  A,[w10]-=2,w5           ; one too far
        inc2    w9,w9
3:      sac.r   A,[w1++]
        movsac  A,[w10]-=2,w5           ; the oldest
        dec     w11,w11
        bra     nz,1b
        mov     w10,[w3+12]
        uncircular
        finished

; fractional *FIRLattice(int n, fractional *dst, fractional *src, FIRStruct *filter): M coefficients, M words of delay,
; not circular. f0 = g0 = x; f[m+1] = f[m] - k[m] * g'[m], g' of the previous sample; g[m+1] = g'[m] - k[m] *
; f[m]; y = f[M].
        .section .text._FIRLattice,code
        .global _FIRLattice
_FIRLattice:
        pushall
        mov     w1,[w15++]
        fractional w4
        mov     [w3+6],w5
        paged   w5,w4
        mov     [w3],w6
        dec     w6,w13
        mov     [w3+2],w9
        mov     [w3+8],w11
        dec     w0,w0
1:      mov     w9,w8
        mov     w11,w10
        mov     [w2++],w5               ; f
        mov     w5,w12                  ; g
        do      w13,2f
        mov     [w8++],w4
        mov     [w10],w6                ; g of the previous sample
        mov     w12,[w10++]
        lac     w5,A
        msc     w4*w6,A
        lac     w6,B
        msc     w4*w5,B
        sac.r   A,w5
2:      sac.r   B,w12
        mov     w5,[w1++]
        dec     w0,w0
        bra     nn,1b
        finished

; fractional *FIRLMS(int n, fractional *dst, fractional *src, FIRStruct *filter, fractional *reference, fractional mu):
; mu * (reference - y) * its sample is added to each coefficient, in RAM.
; fractional *FIRLMSNorm(..., fractional *energy): the gain is mu / (mu + E), E the energy of the samples in the delay.
        .macro  adaptive name,normalised
        .section .text.\name,code
        .global \name
\name:
        pushall
        mov     w1,[w15++]
        mov     w4,w11                  ; reference
        mov     w5,w7                   ; mu
        .if     \normalised
        mov     w6,w13                  ; energy
        .endif
        fractional w4
        push    _PSVPAG
        mov     [w3],w6
        add     w6,w6,w5
        circular w3,w5
        mov     [w3+2],w9
        mov     [w3+12],w10
        dec     w6,w12                  ; taps minus 1
1:      mov     w9,w8
        .if     \normalised
        mov     [w10],w4                ; E - oldest^2 + newest^2
        mov     [w2],w5
        mpy     w4*w4,A
        neg     A
        mac     w5*w5,A
        add     [w13],A
        sac.r   A,[w13]
        .endif
        mov     [w2++],[w10]
        clr     A,[w8]+=2,w4,[w10]+=2,w5
        repeat  w12
        mac     w4*w5,A,[w8]+=2,w4,[w10]+=2,w5
        movsac  A,[w10]-=2,w5           ; at the newest
        sac.r   A,w4
        mov     w4,[w1++]
        lac     [w11++],A
        lac     w4,B
        sub     A
        sac     A,w4                    ; error
        mov     w7,w6
        .if     \normalised
        mov     w0,w8
        mov     w1,[w15++]
        lac     w7,A
        add     [w13],A
        sac     A,w5                    ; mu + E, saturated
        mov     #0x7FFF,w6
        cpsgt   w5,w7                   ; energy 0: the gain is 1
        bra     2f
        repeat  #17
        divf    w7,w5
        mov     w0,w6
2:      mov     [--w15],w1
        mov     w8,w0
        .endif
        mpy     w4*w6,A
        sac.r   A,w6                    ; gain * error
        mov     w9,w8
        clr     A,[w10]+=2,w5
        do      w12,3f
        lac     [w8],A
        mac     w5*w6,A,[w10]+=2,w5
3:      sac.r   A,[w8++]
        movsac  A,[w10]-=2,w5           ; undo the last step, and the oldest
        movsac  A,[w10]-=2,w5
        dec     w0,w0
        bra     nz,1b
        mov     w10,[w3+12]
        uncircular
        finished
        .endm
        adaptive _FIRLMS,0
        adaptive _FIRLMSNorm,1
