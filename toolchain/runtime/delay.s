; SPDX-License-Identifier: MIT
; __delay32 (libpic30.h): W1:W0 instruction cycles. Around the loop: RCALL 2, first subtraction 2, branch 1 or 2, RETURN 3.
; The loop takes 4 cycles per iteration, 3 in the last: `cycles` to `cycles` + 3 in total, at least 9.

        .section .text.___delay32,code
        .global ___delay32
___delay32:
        sub     w0,#8,w0
        subb    w1,#0,w1
        bra     nc,2f
1:      sub     w0,#4,w0
        subb    w1,#0,w1
        bra     c,1b
2:      return
