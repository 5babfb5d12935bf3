; SPDX-License-Identifier: MIT
; First words of a program that arrives as an update; the firmware calls it here at each start. Linked by `openswarm
; program`.
#include "update_slots.h"

    .macro offered name
    .set calls, calls + 1
    .global _\name
    .equ _\name, UPDATE_CALLS + 4 * calls
    .endm

    .set calls, 0
    .include "update_calls.inc"

    .section .update_start, code, address(UPDATE_RUN), keep
    .global __update_start
__update_start:
    clr     TBLPAG                      ; of calls and program
    mov     #UPDATE_CALLS, w1
    tblrdl  [w1], w0
    mov     #(UPDATE_CALLS_MARK + calls), w1
    sub     w0, w1, w0                  ; calls that the firmware offers and this program does not know
    mov     #(0xFF - calls), w1
    cp      w0, w1
    bra     leu, 1f
    reset                               ; another firmware: after three tries it runs without this program
1:  mov     #__dinit_tbloffset, w0      ; abi-elf.md §3.2, of which --no-pack-data leaves two kinds
2:  tblrdl  [w0++], w2                  ; where; 0 ends
    cp0     w2
    bra     z, 4f
    tblrdl  [w0++], w3
    lsr     w3, w3                      ; words
    tblrdl  [w0++], w1                  ; 0: clear them, 1: they follow
3:  clr     w4
    btsc    w1, #0
    tblrdl  [w0++], w4
    mov     w4, [w2++]
    dec     w3, w3
    bra     nz, 3b
    bra     2b
4:  goto    _main
