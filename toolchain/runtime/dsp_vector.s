; SPDX-License-Identifier: MIT
; dsp.h: vectors and matrices of Q15 fractions, 1 element or more. Arguments are in W0...; the destination is returned in
; W0. Comments state the cycles of a call, with RCALL and RETURN, for vectors in RAM.

        .include "dsp.inc"

; fractional *VectorCopy(int n, fractional *dst, fractional *src): 9 + n
        .section .text._VectorCopy,code
        .global _VectorCopy
_VectorCopy:
        dec     w0,w3
        mov     w1,w0
        repeat  w3
        mov     [w2++],[w1++]
        return

; fractional *VectorZeroPad(int n, int zeros, fractional *dst, fractional *src): 15 + n + zeros
        .section .text._VectorZeroPad,code
        .global _VectorZeroPad
_VectorZeroPad:
        dec     w0,w4
        mov     w2,w0
        repeat  w4
        mov     [w3++],[w2++]
        cp0     w1
        bra     z,1f
        dec     w1,w1
        repeat  w1
        clr     [w2++]
1:      return

; fractional *VectorNegate(int n, fractional *dst, fractional *src): 0x8000 becomes 0x7FFF
        .section .text._VectorNegate,code
        .global _VectorNegate
_VectorNegate:
        fractional w3
        dec     w0,w3
        mov     w1,w0
        do      w3,1f
        lac     [w2++],A
        neg     A
1:      sac     A,[w1++]
        pop     _CORCON
        return

; fractional *VectorScale(int n, fractional *dst, fractional *src, fractional factor)
        .section .text._VectorScale,code
        .global _VectorScale
_VectorScale:
        mov     w3,w5
        fractional w3
        dec     w0,w3
        mov     w1,w0
        do      w3,1f
        mov     [w2++],w4
        mpy     w4*w5,A
1:      sac.r   A,[w1++]
        pop     _CORCON
        return

; fractional *VectorAdd(int n, fractional *dst, fractional *a, fractional *b)
        .section .text._VectorAdd,code
        .global _VectorAdd
_VectorAdd:
        fractional w4
        dec     w0,w4
        mov     w1,w0
        do      w4,1f
        lac     [w2++],A
        add     [w3++],A
1:      sac     A,[w1++]
        pop     _CORCON
        return

; fractional *VectorSubtract(int n, fractional *dst, fractional *a, fractional *b)
        .section .text._VectorSubtract,code
        .global _VectorSubtract
_VectorSubtract:
        fractional w4
        dec     w0,w4
        mov     w1,w0
        do      w4,1f
        lac     [w2++],A
        lac     [w3++],B
        sub     A
1:      sac     A,[w1++]
        pop     _CORCON
        return

; fractional *VectorMultiply(int n, fractional *dst, fractional *a, fractional *b)
; fractional *VectorWindow(int n, fractional *dst, fractional *src, fractional *window)
        .section .text._VectorMultiply,code
        .global _VectorMultiply
        .global _VectorWindow
_VectorMultiply:
_VectorWindow:
        fractional w4
        dec     w0,w6
        mov     w1,w0
        do      w6,1f
        mov     [w2++],w4
        mov     [w3++],w5
        mpy     w4*w5,A
1:      sac.r   A,[w1++]
        pop     _CORCON
        return

; fractional VectorPower(int n, fractional *src): 2 cycles per element
        .section .text._VectorPower,code
        .global _VectorPower
_VectorPower:
        fractional w2
        dec     w0,w0
        clr     A
        do      w0,1f
        mov     [w1++],w4
1:      mac     w4*w4,A
        sac.r   A,w0
        pop     _CORCON
        return

; fractional VectorDotProduct(int n, fractional *a, fractional *b)
; If one vector is in X RAM and the other in Y RAM, MAC reads both in 1 cycle per element. Otherwise 3 cycles.
        .section .text._VectorDotProduct,code
        .global _VectorDotProduct
_VectorDotProduct:
        fractional w3
        mov     #__YDATA_BASE,w4
        cp      w2,w4                   ; exchange the vectors unless the second is in Y
        bra     geu,1f
        exch    w1,w2
1:      add     w0,w0,w3
        add     w1,w3,w3                ; end of the vector that must be in X
        cp      w3,w4
        bra     gtu,2f
        cp      w2,w4
        bra     ltu,2f
        cp0     w2                      ; program memory is read as X
        bra     n,2f
        mov     w8,[w15++]
        mov     w10,[w15++]
        mov     w1,w8
        mov     w2,w10
        sub     w0,#2,w0
        clr     A,[w8]+=2,w4,[w10]+=2,w5
        bra     n,4f
        repeat  w0
        mac     w4*w5,A,[w8]+=2,w4,[w10]+=2,w5
4:      mac     w4*w5,A                 ; the last element, without prefetch
        mov     [--w15],w10
        mov     [--w15],w8
        sac.r   A,w0
        pop     _CORCON
        return
2:      dec     w0,w0
        clr     A
        do      w0,3f
        mov     [w1++],w4
        mov     [w2++],w5
3:      mac     w4*w5,A
        sac.r   A,w0
        pop     _CORCON
        return

; fractional VectorMax(int n, fractional *src, int *index), VectorMin: the last of equal elements
        .macro  extreme name,skip
        .section .text.\name,code
        .global \name
\name:
        mov     [w1++],w4               ; W5:W4 index and value of the extreme, W7:W6 of the next element
        clr     w5
        mov     #1,w7
        sub     w0,#2,w0
        bra     n,2f
        do      w0,1f
        mov     [w1++],w6
        \skip   w4,w6
        mov.d   w6,w4
1:      inc     w7,w7
2:      mov     w5,[w2]
        mov     w4,w0
        return
        .endm
        extreme _VectorMax,cpsgt
        extreme _VectorMin,cpslt

; fractional *VectorConvolve(int n, int m, fractional *dst, fractional *x, fractional *h), m <= n:
; dst[i] is the sum of x[k] * h[i-k], i < n+m-1. VectorCorrelate: sum of x[k] * y[k+m-1-i]. 3 cycles per product.
        .macro  sliding name,toward,partner
        .section .text.\name,code
        .global \name
\name:
        fractional w5
        pushall
        mov     w2,[w15++]
        dec     w1,w10
        dec     w0,w11
        add     w10,w11,w12             ; last i
        mov     w4,w6                   ; partner of x[0] in the first sum
        .ifc    \toward,sub
        add     w10,w10,w7
        add     w6,w7,w6
        .endif
        clr     w9                      ; i
1:      sub     w9,w10,w0               ; first k: i-(m-1), at least 0
        btsc    w0,#15
        clr     w0
        mov     w9,w1                   ; last k: i, at most n-1
        cpslt   w9,w11
        mov     w11,w1
        sub     w1,w0,w1
        sub     w9,w0,w7
        add     w7,w7,w7
        \toward     w6,w7,w8
        add     w0,w0,w0
        add     w3,w0,w0
        clr     A
        do      w1,2f
        mov     [w0++],w4
        mov     [\partner],w5
2:      mac     w4*w5,A
        sac.r   A,[w2++]
        inc     w9,w9
        dec     w12,w12
        bra     nn,1b
        mov     [--w15],w0
        popall
        pop     _CORCON
        return
        .endm
        sliding _VectorConvolve,add,w8--
        sliding _VectorCorrelate,sub,w8++

; MatrixAdd, MatrixSubtract (int rows, int columns, fractional *dst, fractional *a, fractional *b), and MatrixScale
; (..., fractional *src, fractional factor) call the vector functions.
        .macro  elementwise name,vector
        .section .text.\name,code
        .global \name
\name:
        mul.uu  w0,w1,w0
        mov     w2,w1
        mov     w3,w2
        mov     w4,w3
        bra     \vector
        .endm
        elementwise _MatrixAdd,_VectorAdd
        elementwise _MatrixSubtract,_VectorSubtract
        elementwise _MatrixScale,_VectorScale

; fractional *MatrixMultiply(int rows, int inner, int columns, fractional *dst, fractional *a, fractional *b):
; dst is neither a nor b. 4 cycles per product.
        .section .text._MatrixMultiply,code
        .global _MatrixMultiply
_MatrixMultiply:
        pushall
        fractional w6
        mov     w3,[w15++]
        mov     w4,w6                   ; row of a
        mov     w5,w7                   ; b
        dec     w1,w9                   ; products of a sum minus 1
        add     w1,w1,w10               ; bytes of a row of a
        dec     w2,w11
        add     w2,w2,w12               ; bytes of a row of b
        dec     w0,w0
1:      mov     w7,w1                   ; column of b
        do      w11,3f
        mov     w6,w2
        mov     w1,w8
        clr     A
        do      w9,2f
        mov     [w2++],w4
        mov     [w8],w5
        add     w8,w12,w8
2:      mac     w4*w5,A
        inc2    w1,w1
3:      sac.r   A,[w3++]
        add     w6,w10,w6
        dec     w0,w0
        bra     nn,1b
        mov     [--w15],w0
        pop     _CORCON
        popall
        return

; fractional *MatrixTranspose(int rows, int columns, fractional *dst, fractional *src); dst may be src if it is square
        .section .text._MatrixTranspose,code
        .global _MatrixTranspose
_MatrixTranspose:
        mov     w2,[w15++]
        add     w1,w1,w4                ; bytes of a row
        cp      w2,w3
        bra     z,3f
        dec     w0,w0
1:      mov     w3,w5
        do      w0,2f
        mov     [w5],[w2++]
2:      add     w5,w4,w5
        inc2    w3,w3
        dec     w1,w1
        bra     nz,1b
        mov     [--w15],w0
        return
3:      sub     w0,#2,w0                ; exchanges of the first row minus 1
        bra     n,6f
4:      mov     w2,w5                   ; pointers along the row and down the column, from the diagonal
        mov     w2,w3
        do      w0,5f
        add     w3,w4,w3
        mov     [++w5],w6
        mov     [w3],[w5]
5:      mov     w6,[w3]
        add     w2,w4,w2
        inc2    w2,w2
        dec     w0,w0
        bra     nn,4b
6:      mov     [--w15],w0
        return
