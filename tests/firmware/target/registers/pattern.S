; Threads that fill every register with a pattern of their own and check it for ever (kernel.md §4).
;
; A round lasts some 60 instructions, most of which another thread would notice if it changed anything. checked counts
; the rounds, broken becomes the number of the thread whose registers changed.


; fill sets Wn to seed + n * 0x101, n = 1 to 14; W0 is scratch. RCOUNT is checked by a REPEAT that must run to its end.
        .macro  fill seed
        mov     #\seed+0x0101, w1
        mov     #\seed+0x0202, w2
        mov     #\seed+0x0303, w3
        mov     #\seed+0x0404, w4
        mov     #\seed+0x0505, w5
        mov     #\seed+0x0606, w6
        mov     #\seed+0x0707, w7
        mov     #\seed+0x0808, w8
        mov     #\seed+0x0909, w9
        mov     #\seed+0x0A0A, w10
        mov     #\seed+0x0B0B, w11
        mov     #\seed+0x0C0C, w12
        mov     #\seed+0x0D0D, w13
        mov     #\seed+0x0E0E, w14
        mov     #\seed & 0x7F, w0
        mov     w0, TBLPAG
        .endm

        .macro  compare register, value, bad
        mov     #\value, w0
        cpseq   w0, \register
        bra     \bad
        .endm

        .macro  compare_all seed, bad
        compare w1, \seed+0x0101, \bad
        compare w2, \seed+0x0202, \bad
        compare w3, \seed+0x0303, \bad
        compare w4, \seed+0x0404, \bad
        compare w5, \seed+0x0505, \bad
        compare w6, \seed+0x0606, \bad
        compare w7, \seed+0x0707, \bad
        compare w8, \seed+0x0808, \bad
        compare w9, \seed+0x0909, \bad
        compare w10, \seed+0x0A0A, \bad
        compare w11, \seed+0x0B0B, \bad
        compare w12, \seed+0x0C0C, \bad
        compare w13, \seed+0x0D0D, \bad
        compare w14, \seed+0x0E0E, \bad
        mov     TBLPAG, w0
        sub     #\seed & 0x7F, w0
        bra     nz, \bad
        .endm

; REPEAT #23 in the middle: W0 counts its iterations, so RCOUNT and SR.RA are checked as well. Flags are checked by the
; carry that a compare leaves over a stretch of moves.
        .macro  pattern_thread name, seed, number, counter
        .global \name
\name:
        fill    \seed
1:      clr     w0
        repeat  #23
        inc     w0, w0
        sub     #24, w0
        bra     nz, 9f
        bset    SR, #0                  ; C
        mov     w1, w0
        mov     w2, w0
        mov     w3, w0
        bra     nc, 9f
        bclr    SR, #0
        mov     w4, w0
        mov     w5, w0
        mov     w6, w0
        bra     c, 9f
        compare_all \seed, 9f
        inc     \counter
        bra     1b
9:      mov     #\number, w0
        mov     w0, _broken
8:      bra     8b
        .endm

        .text
        pattern_thread _pattern_one, 0x1011, 1, _checked
        pattern_thread _pattern_two, 0x2022, 2, _checked+2

; A DSP thread adds accumulators, CORCON and two nested DO loops whose iterations are counted.
        .macro  accumulator low, high, upper, value, bad
        mov     \low, w0
        sub     #(\value & 0xFF), w0
        bra     nz, \bad
        mov     \high, w0
        sub     #((\value+1) & 0xFF), w0
        bra     nz, \bad
        mov     \upper, w0
        and     #0xFF, w0
        sub     #((\value+2) & 0x7F), w0
        bra     nz, \bad
        .endm

        .macro  set_accumulator low, high, upper, value
        mov     #(\value & 0xFF), w0
        mov     w0, \low
        mov     #((\value+1) & 0xFF), w0
        mov     w0, \high
        mov     #((\value+2) & 0x7F), w0
        mov     w0, \upper
        .endm

        .macro  dsp_thread name, seed, number, counter, corcon, outer, inner
        .global \name
\name:
        fill    \seed
        mov     #\corcon, w0            ; with PSV, which compiled code relies on
        mov     w0, CORCON
        set_accumulator ACCAL, ACCAH, ACCAU, \number*16
        set_accumulator ACCBL, ACCBH, ACCBU, \number*32
1:      clr     w0
        do      #\outer-1, 3f
        do      #\inner-1, 2f
        inc     w0, w0
        nop
2:      nop
        nop
3:      nop
        mov     #\outer*\inner, w1
        cpseq   w0, w1
        bra     9f
        mov     #\seed+0x0101, w1
        accumulator ACCAL, ACCAH, ACCAU, \number*16, 9f
        accumulator ACCBL, ACCBH, ACCBU, \number*32, 9f
        mov     CORCON, w0
        sub     w0, #0, w0
        mov     #\corcon, w1
        cpseq   w0, w1
        bra     9f
        mov     #\seed+0x0101, w1
        compare_all \seed, 9f
        inc     \counter
        bra     1b
9:      mov     #\number, w0
        mov     w0, _broken
8:      bra     8b
        .endm

        dsp_thread _pattern_dsp_one, 0x3033, 3, _checked+4, 0x00F7, 3, 4
        dsp_thread _pattern_dsp_two, 0x4044, 4, _checked+6, 0x1026, 5, 2

; 100 us device: T4 at IPL 4 sends an event from C.
#include "hal_limits.h"
#include "isr.inc"
        isr     __T4Interrupt, _storm_isr
