; SPDX-License-Identifier: MIT
; strlen, strcpy, strcmp, strncmp (C11 7.24).

        .section .text._strlen,code
        .global _strlen
_strlen:
        mov     w0,w1
1:      cp0.b   [w0++]
        bra     nz,1b
        sub     w0,w1,w0
        dec     w0,w0
        return

        .section .text._strcpy,code
        .global _strcpy
_strcpy:
        mov     w0,w2
1:      cp0.b   [w1]
        mov.b   [w1++],[w2++]           ; changes no flags
        bra     nz,1b
        return

        .section .text._strcmp,code
        .global _strcmp
_strcmp:
        ze      [w0++],w2
        ze      [w1++],w3
        sub     w2,w3,w4
        bra     nz,1f
        cp0     w2
        bra     nz,_strcmp
1:      mov     w4,w0
        return

        .section .text._strncmp,code
        .global _strncmp
_strncmp:
        clr     w5
1:      dec     w2,w2
        bra     nc,2f                   ; borrow: no character left
        ze      [w0++],w3
        ze      [w1++],w4
        sub     w3,w4,w5
        bra     nz,2f
        cp0     w3
        bra     nz,1b
2:      mov     w5,w0
        return
