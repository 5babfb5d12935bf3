; SPDX-License-Identifier: MIT
; memcpy, memmove, memset, memcmp (C11 7.24): one REPEAT per call, by words if both pointers are even.
; REPEAT counts to 16384, more than the data space holds.

        .section .text._memcpy,code
        .global _memcpy
        .global ___memcpy_upwards       ; for memmove, even if the program defines a memcpy
_memcpy:
___memcpy_upwards:
        mov     w0,w3
        ior     w0,w1,w4
        btsc    w4,#0
        bra     2f
        lsr     w2,w4
        bra     z,1f
        dec     w4,w4
        repeat  w4
        mov     [w1++],[w3++]
1:      btsc    w2,#0
        mov.b   [w1],[w3]
        return
2:      dec     w2,w2
        bra     n,3f
        repeat  w2
        mov.b   [w1++],[w3++]
3:      return

        .section .text._memmove,code
        .global _memmove
_memmove:
        cp      w0,w1
        bra     leu,___memcpy_upwards   ; an upward copy is correct
        add     w1,w2,w1
        add     w0,w2,w3
        ior     w1,w3,w4
        ior     w4,w2,w4
        btsc    w4,#0
        bra     1f
        lsr     w2,w2
        dec     w2,w2
        bra     n,2f
        repeat  w2
        mov     [--w1],[--w3]
        return
1:      dec     w2,w2
        bra     n,2f
        repeat  w2
        mov.b   [--w1],[--w3]
2:      return

        .section .text._memset,code
        .global _memset
_memset:
        mov     w0,w3
        cp0     w2
        bra     z,2f
        btss    w3,#0
        bra     1f
        mov.b   w1,[w3++]               ; first byte up to an even address
        dec     w2,w2
1:      ze      w1,w1
        sl      w1,#8,w4
        ior     w1,w4,w1
        lsr     w2,w4
        bra     z,3f
        dec     w4,w4
        repeat  w4
        mov     w1,[w3++]
3:      btsc    w2,#0
        mov.b   w1,[w3]
2:      return

        .section .text._memcmp,code
        .global _memcmp
_memcmp:
        clr     w3
        cp0     w2
        bra     z,2f
1:      ze      [w0++],w3
        ze      [w1++],w4
        sub     w3,w4,w3
        bra     nz,2f
        dec     w2,w2
        bra     nz,1b
2:      mov     w3,w0
        return
