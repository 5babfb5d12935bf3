; SPDX-License-Identifier: MIT
; Functions of XC16's divide builtins and interrupt-priority builtins (abi-elf.md §2.9, dspic_builtins.h).
; Dividend in W1:W0, divisor in W2; DIV leaves the quotient in W0, the remainder in W1 (isa.md §6.7).

        .section .text.___dspic_divsd,code
        .global ___dspic_divsd
___dspic_divsd:
        repeat  #17
        div.sd  w0,w2
        return

        .section .text.___dspic_divud,code
        .global ___dspic_divud
___dspic_divud:
        repeat  #17
        div.ud  w0,w2
        return

        .section .text.___dspic_modsd,code
        .global ___dspic_modsd
___dspic_modsd:
        repeat  #17
        div.sd  w0,w2
        mov     w1,w0
        return

        .section .text.___dspic_modud,code
        .global ___dspic_modud
___dspic_modud:
        repeat  #17
        div.ud  w0,w2
        mov     w1,w0
        return

        .section .text.___dspic_divmodsd,code
        .global ___dspic_divmodsd
___dspic_divmodsd:
        repeat  #17
        div.sd  w0,w2
        mov     w1,[w3]
        return

        .section .text.___dspic_divmodud,code
        .global ___dspic_divmodud
___dspic_divmodud:
        repeat  #17
        div.ud  w0,w2
        mov     w1,[w3]
        return

; Return the fractional quotient of W0 / W1, |W0| < |W1|.
        .section .text.___dspic_divf,code
        .global ___dspic_divf
___dspic_divf:
        mov     w1,w2
        repeat  #17
        divf    w0,w2
        return

; Set SR.IPL (bits 7-5 of SR) to W0; DISI protects the read-modify-write.
        .section .text.___dspic_set_isr_state,code
        .global ___dspic_set_isr_state
___dspic_set_isr_state:
        and     w0,#7,w0
        sl      w0,#5,w0
        mov     #0x1F,w2
        disi    #4
        mov     _SR,w1
        and     w1,w2,w1
        ior     w0,w1,w0
        mov     w0,_SR
        return
