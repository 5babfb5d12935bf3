; SPDX-License-Identifier: MIT
; 32-bit integer helpers (abi-elf.md §2.8): arguments in W1:W0 and W3:W2, result in W1:W0. They change W0-W7 only.

        .section .text.___mulsi3,code
        .global ___mulsi3
___mulsi3:
        mul.ss  w1,w2,w4
        mul.ss  w0,w3,w6
        mul.uu  w0,w2,w0
        add     w1,w4,w1
        add     w1,w6,w1
        return

; Unsigned quotient in W1:W0, remainder in W5:W4. Division by zero causes the math error trap, as with DIV. The other
; functions call it by the name for both results, because a ___udivsi3 of the program returns no remainder.
        .section .text.___udivsi3,code
        .global ___udivsi3
        .global ___udivmodsi4
___udivsi3:
___udivmodsi4:
        cp0     w3
        bra     nz,divisor_32
        mov     w0,w4                   ; divide two digits of 16 bits, the high one first
        repeat  #17
        div.uw  w1,w2
        mov     w0,w5
        mov     w4,w0
        repeat  #17
        div.ud  w0,w2
        mov     w1,w4
        mov     w5,w1
        clr     w5
        return
; The quotient has 16 bits. Estimate it by the upper 16 bits of the divisor; the estimate is exact or one too small
; (H. S. Warren, Hacker's Delight, 2nd edition, section 9-5: doubleword from word division).
divisor_32:
        ff1l    w3,w4
        dec     w4,w4                   ; s = leading zeros of the divisor
        sl      w3,w4,w5
        subr    w4,#16,w6
        lsr     w2,w6,w6                ; 0 for a count of 16 (isa.md §6.3)
        ior     w5,w6,w6                ; divisor << s, upper 16 bits
        mov.d   w0,[w15++]
        lsr     w1,w1
        rrc     w0,w0
        repeat  #17
        div.ud  w0,w6
        subr    w4,#15,w5
        lsr     w0,w5,w0
        cp0     w0
        bra     z,1f
        dec     w0,w0
1:      mul.uu  w0,w2,w6
        mul.uu  w0,w3,w4
        add     w7,w4,w7
        mov.d   [--w15],w4
        sub     w4,w6,w4
        subb    w5,w7,w5
        clr     w1
        cp      w4,w2
        cpb     w5,w3
        bra     ltu,2f
        sub     w4,w2,w4
        subb    w5,w3,w5
        inc     w0,w0
2:      return

        .section .text.___umodsi3,code
        .global ___umodsi3
___umodsi3:
        rcall   ___udivmodsi4
        mov.d   w4,w0
        return

        .section .text.___divsi3,code
        .global ___divsi3
___divsi3:
        xor     w1,w3,[w15++]           ; its sign is the quotient's
        rcall   ___absolutesi2
        rcall   ___udivmodsi4
        btsc    [--w15],#15
        bra     ___negsi2
        return

        .section .text.___modsi3,code
        .global ___modsi3
___modsi3:
        mov     w1,[w15++]              ; the remainder has the sign of the dividend (C11 6.5.5p6)
        rcall   ___absolutesi2
        rcall   ___udivmodsi4
        mov.d   w4,w0
        btsc    [--w15],#15
        bra     ___negsi2
        return

; Replace W1:W0 and W3:W2 by their magnitudes.
        .section .text.___absolutesi2,code
        .global ___absolutesi2
___absolutesi2:
        btss    w3,#15
        bra     1f
        subr    w2,#0,w2
        subbr   w3,#0,w3
1:      btss    w1,#15
        return
        .global ___negsi2
___negsi2:
        subr    w0,#0,w0
        subbr   w1,#0,w1
        return

; Shifts of W1:W0 by W2, 0..31, in constant time.
        .section .text.___ashlsi3,code
        .global ___ashlsi3
___ashlsi3:
        btsc    w2,#4
        bra     1f
        subr    w2,#16,w3
        lsr     w0,w3,w3
        sl      w1,w2,w1
        ior     w1,w3,w1
        sl      w0,w2,w0
        return
1:      and     w2,#15,w2
        sl      w0,w2,w1
        clr     w0
        return

        .section .text.___lshrsi3,code
        .global ___lshrsi3
___lshrsi3:
        btsc    w2,#4
        bra     1f
        subr    w2,#16,w3
        sl      w1,w3,w3
        lsr     w0,w2,w0
        ior     w0,w3,w0
        lsr     w1,w2,w1
        return
1:      and     w2,#15,w2
        lsr     w1,w2,w0
        clr     w1
        return

        .section .text.___ashrsi3,code
        .global ___ashrsi3
___ashrsi3:
        btsc    w2,#4
        bra     1f
        subr    w2,#16,w3
        sl      w1,w3,w3
        lsr     w0,w2,w0
        ior     w0,w3,w0
        asr     w1,w2,w1
        return
1:      and     w2,#15,w2
        asr     w1,w2,w0
        asr     w1,#15,w1
        return
