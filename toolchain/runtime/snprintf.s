; SPDX-License-Identifier: MIT
; snprintf, sprintf, vsnprintf, vsprintf (C11 7.21.6): a sink_t (format.h) on the stack around one call of __format.
; The last named argument and all later ones are on the stack, the earlier ones in registers (abi-elf.md §2.2
; rule 5).

        .section .text._snprintf,code
        .global _snprintf
_snprintf:
        mov     [w15-6],w2
        sub     w15,#6,w3               ; va_start: address of the last named argument
        bra     _vsnprintf

        .section .text._sprintf,code
        .global _sprintf
_sprintf:
        mov     [w15-6],w2
        sub     w15,#6,w3
        com     w0,w1                   ; size: all addresses above the buffer
        bra     _vsnprintf

        .section .text._vsprintf,code
        .global _vsprintf
_vsprintf:
        mov     w2,w3
        mov     w1,w2
        com     w0,w1
        bra     _vsnprintf

        .section .note.bounds,info      ; TARGETS_OF of bounds.h
        .ascii  "targets format_put vsnprintf_store@runtime/snprintf.s:1\n"
        .ascii  "targets __format_pad vsnprintf_store@runtime/snprintf.s:1\n"
        .ascii  "targets __format_field vsnprintf_store@runtime/snprintf.s:1\n"
        .ascii  "targets __format_double vsnprintf_store@runtime/snprintf.s:1\n"

        .section .text._vsnprintf,code
        .global _vsnprintf
_vsnprintf:
        mov     #handle(vsnprintf_store),w4
        mov     w4,[w15++]              ; put
        sub     w15,#2,w5
        cp0     w1                      ; size 0: no character may be stored, so let `at` point to this sink
        bra     nz,1f
        mov     w5,w0
        mov     #1,w1
1:      mov     w0,[w15++]              ; at
        add     w0,w1,w0
        dec     w0,[w15++]              ; end: the position of the final 0
        clr     [w15++]                 ; count
        mov     w5,w0
        mov     w2,w1
        mov     w3,w2
        rcall   ___format
        mov     [w15-6],w1
        clr.b   [w1]
        sub     w15,#8,w15
        return

vsnprintf_store:
        add     w0,#6,w2                ; count every character, store those that fit
        inc     [w2],[w2]
        mov     [w0+2],w2
        mov     [w0+4],w3
        cp      w2,w3
        bra     z,1f
        mov.b   w1,[w2++]
        mov     w2,[w0+2]
1:      return
