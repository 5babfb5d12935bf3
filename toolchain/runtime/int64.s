; SPDX-License-Identifier: MIT
; 64-bit integer helpers (abi-elf.md §2.8): arguments in W3..W0 and W7..W4, result in W3..W0.

; Low 64 bits of the product: the 16x16 products whose weight is below 2^64, highest weight first, so that each
; argument word is dead when its register becomes an accumulator.
        .section .text.___muldi3,code
        .global ___muldi3
___muldi3:
        mov.d   w8,[w15++]
        mul.uu  w3,w4,w8
        mov     w8,w3
        mul.uu  w0,w7,w8
        add     w3,w8,w3
        mul.uu  w2,w5,w8
        add     w3,w8,w3
        mul.uu  w1,w6,w8
        add     w3,w8,w3                ; bits 63-48 so far
        mul.uu  w2,w4,w8
        mov     w8,w7                   ; bits 47-32
        add     w3,w9,w3
        mul.uu  w0,w6,w8
        add     w7,w8,w7
        addc    w3,w9,w3
        mul.uu  w1,w5,w8
        add     w7,w8,w7
        addc    w3,w9,w3
        mul.uu  w1,w4,w8
        mov     w8,w6                   ; bits 31-16
        add     w7,w9,w7
        addc    w3,#0,w3
        mul.uu  w0,w5,w8
        add     w6,w8,w6
        addc    w7,w9,w7
        addc    w3,#0,w3
        mul.uu  w0,w4,w0
        add     w1,w6,w1
        addc    w7,#0,w2
        addc    w3,#0,w3
        mov.d   [--w15],w8
        return

; Unsigned quotient in W3..W0, remainder in W7..W4. Division by zero causes the math error trap.
        .section .text.___udivmoddi4_,code
        .global ___udivmoddi4_
___udivmoddi4_:
        mov.d   w8,[w15++]
        mov.d   w10,[w15++]
        ior     w5,w6,w8
        ior     w8,w7,w8
        bra     nz,wide_divisor
        mov.d   w0,w8                   ; divisor of 16 bits: four hardware divisions, highest digit first
        mov     w2,w10
        repeat  #17
        div.uw  w3,w4
        mov     w0,w3
        mov     w10,w0
        repeat  #17
        div.ud  w0,w4
        mov     w0,w2
        mov     w9,w0
        repeat  #17
        div.ud  w0,w4
        mov     w0,w9
        mov     w8,w0
        repeat  #17
        div.ud  w0,w4
        mov     w1,w4
        mov     w9,w1
        mov.d   [--w15],w10
        mov.d   [--w15],w8
        return

wide_divisor:
        mov.d   w12,[w15++]
        mul.uu  w8,#0,w8                ; remainder in W11..W8
        mul.uu  w10,#0,w10
        mov     #64,w12
1:      cp0     w3                      ; skip leading zero words of the dividend
        bra     nz,2f
        mov     w2,w3
        mov     w1,w2
        mov     w0,w1
        clr     w0
        sub     w12,#16,w12
        bra     nz,1b
        bra     5f
2:      add     w0,w0,w0                ; shift dividend into remainder
        addc    w1,w1,w1
        addc    w2,w2,w2
        addc    w3,w3,w3
        addc    w8,w8,w8
        addc    w9,w9,w9
        addc    w10,w10,w10
        addc    w11,w11,w11
        bra     c,3f                    ; the remainder has 65 bits: larger than any divisor
        cp      w8,w4
        cpb     w9,w5
        cpb     w10,w6
        cpb     w11,w7
        bra     ltu,4f
3:      sub     w8,w4,w8
        subb    w9,w5,w9
        subb    w10,w6,w10
        subb    w11,w7,w11
        bset    w0,#0
4:      dec     w12,w12
        bra     nz,2b
5:      mov.d   w8,w4
        mov.d   w10,w6
        mov.d   [--w15],w12
        mov.d   [--w15],w10
        mov.d   [--w15],w8
        return

        .section .text.___udivdi3,code
        .global ___udivdi3
___udivdi3:
        bra     ___udivmoddi4_

        .section .text.___umoddi3,code
        .global ___umoddi3
___umoddi3:
        rcall   ___udivmoddi4_
        mov.d   w4,w0
        mov.d   w6,w2
        return

        .section .text.___divdi3,code
        .global ___divdi3
___divdi3:
        xor     w3,w7,[w15++]
        rcall   ___absolutedi2
        rcall   ___udivmoddi4_
        btsc    [--w15],#15
        bra     ___negdi2
        return

        .section .text.___moddi3,code
        .global ___moddi3
___moddi3:
        mov     w3,[w15++]
        rcall   ___absolutedi2
        rcall   ___udivmoddi4_
        mov.d   w4,w0
        mov.d   w6,w2
        btsc    [--w15],#15
        bra     ___negdi2
        return

; Replace both arguments by their magnitudes.
        .section .text.___absolutedi2,code
        .global ___absolutedi2
___absolutedi2:
        btss    w7,#15
        bra     1f
        subr    w4,#0,w4
        subbr   w5,#0,w5
        subbr   w6,#0,w6
        subbr   w7,#0,w7
1:      btss    w3,#15
        return
        .global ___negdi2
___negdi2:
        subr    w0,#0,w0
        subbr   w1,#0,w1
        subbr   w2,#0,w2
        subbr   w3,#0,w3
        return

; Shifts of W3..W0 by W4, 0..63: whole words first.
        .section .text.___ashldi3,code
        .global ___ashldi3
___ashldi3:
        sub     w4,#16,w5
        bra     n,1f
        mov     w5,w4
        mov     w2,w3
        mov     w1,w2
        mov     w0,w1
        clr     w0
        bra     ___ashldi3
1:      neg     w5,w5                   ; 16 - count
        sl      w3,w4,w3
        lsr     w2,w5,w6
        ior     w3,w6,w3
        sl      w2,w4,w2
        lsr     w1,w5,w6
        ior     w2,w6,w2
        sl      w1,w4,w1
        lsr     w0,w5,w6
        ior     w1,w6,w1
        sl      w0,w4,w0
        return

        .section .text.___lshrdi3,code
        .global ___lshrdi3
___lshrdi3:
        clr     w7
        bra     ___shrdi3_

        .section .text.___ashrdi3,code
        .global ___ashrdi3
___ashrdi3:
        asr     w3,#15,w7
        bra     ___shrdi3_

; Right shift; W7 is the value of words shifted in.
        .section .text.___shrdi3_,code
        .global ___shrdi3_
___shrdi3_:
        sub     w4,#16,w5
        bra     n,1f
        mov     w5,w4
        mov     w1,w0
        mov     w2,w1
        mov     w3,w2
        mov     w7,w3
        bra     ___shrdi3_
1:      neg     w5,w5
        lsr     w0,w4,w0
        sl      w1,w5,w6
        ior     w0,w6,w0
        lsr     w1,w4,w1
        sl      w2,w5,w6
        ior     w1,w6,w1
        lsr     w2,w4,w2
        sl      w3,w5,w6
        ior     w2,w6,w2
        lsr     w3,w4,w3
        sl      w7,w5,w6
        ior     w3,w6,w3
        return
