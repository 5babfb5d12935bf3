; SPDX-License-Identifier: MIT
; Functions of __builtin_clz, ctz, ffs, popcount, parity (abi-elf.md §2.8). Arguments from W0 up, result in W0.
; clz and ctz of 0 are undefined in C; these functions return the width.

        .section .text.___clzhi2,code
        .global ___clzhi2
___clzhi2:
        ff1l    w0,w0                   ; 1 + leading zeros, or 0
        bra     c,1f
        dec     w0,w0
        return
1:      retlw   #16,w0

        .section .text.___clzsi2,code
        .global ___clzsi2
___clzsi2:
        ff1l    w1,w1
        bra     c,1f
        dec     w1,w0
        return
1:      rcall   ___clzhi2
        add     w0,#16,w0
        return

        .section .text.___clzdi2,code
        .global ___clzdi2
___clzdi2:
        ior     w2,w3,w4
        bra     z,1f
        mov.d   w2,w0
        bra     ___clzsi2
1:      rcall   ___clzsi2
        add     #32,w0
        return

        .section .text.___ctzhi2,code
        .global ___ctzhi2
___ctzhi2:
        ff1r    w0,w0                   ; 1 + trailing zeros, or 0
        bra     c,1f
        dec     w0,w0
        return
1:      retlw   #16,w0

        .section .text.___ctzsi2,code
        .global ___ctzsi2
___ctzsi2:
        ff1r    w0,w0
        bra     c,1f
        dec     w0,w0
        return
1:      mov     w1,w0
        rcall   ___ctzhi2
        add     w0,#16,w0
        return

        .section .text.___ctzdi2,code
        .global ___ctzdi2
___ctzdi2:
        ior     w0,w1,w4
        bra     z,1f
        bra     ___ctzsi2
1:      mov.d   w2,w0
        rcall   ___ctzsi2
        add     #32,w0
        return

        .section .text.___ffshi2,code
        .global ___ffshi2
___ffshi2:
        ff1r    w0,w0
        return

        .section .text.___ffssi2,code
        .global ___ffssi2
___ffssi2:
        ior     w0,w1,w2
        bra     nz,1f
        return
1:      rcall   ___ctzsi2
        inc     w0,w0
        return

        .section .text.___ffsdi2,code
        .global ___ffsdi2
___ffsdi2:
        ior     w0,w1,w4
        ior     w4,w2,w4
        ior     w4,w3,w4
        bra     nz,1f
        return
1:      rcall   ___ctzdi2
        inc     w0,w0
        return

        .section .text.___popcounthi2,code
        .global ___popcounthi2
___popcounthi2:
        clr     w1
1:      lsr     w0,w0                   ; bit into C
        addc    w1,#0,w1
        cp0     w0
        bra     nz,1b
        mov     w1,w0
        return

        .section .text.___popcountsi2,code
        .global ___popcountsi2
___popcountsi2:
        mov     w1,w2
        rcall   ___popcounthi2
        exch    w0,w2
        rcall   ___popcounthi2
        add     w0,w2,w0
        return

        .section .text.___popcountdi2,code
        .global ___popcountdi2
___popcountdi2:
        mov.d   w2,w4
        rcall   ___popcountsi2
        mov     w0,w3
        mov.d   w4,w0
        rcall   ___popcountsi2
        add     w0,w3,w0
        return

        .section .text.___parityhi2,code
        .global ___parityhi2
___parityhi2:
        rcall   ___popcounthi2
        and     w0,#1,w0
        return

        .section .text.___paritysi2,code
        .global ___paritysi2
___paritysi2:
        xor     w0,w1,w0
        bra     ___parityhi2

        .section .text.___paritydi2,code
        .global ___paritydi2
___paritydi2:
        xor     w0,w1,w0
        xor     w0,w2,w0
        xor     w0,w3,w0
        bra     ___parityhi2
