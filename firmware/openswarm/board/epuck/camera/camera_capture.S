/* SPDX-License-Identifier: MIT */
; Line capture at IPL 6. It saves registers by PUSH.S only and calls no function; independent of the kernel.
;
; The sensor puts byte k of a line on RD8-RD15 from 8 k - 4 to 8 k + 4 Tcy after the rise of HREF. The first read is the
; 11th Tcy of the interrupt function, 16-18 Tcy after HREF, so it takes byte 2, the high byte of pixel 1; the window
; begins a pixel early for that (epuck.md §7.5). From there every second pixel is taken: 32 Tcy each. The low byte comes
; 8 Tcy after the high one. RCOUNT belongs to the interrupted code and waits in W2.
#include "camera_sensor.h"
        .equ    T4IF, 5                 ; IFS1 (dspic30f6014a.md §5)
        .equ    T5IF, 6
        .equ    OC8IF, 3                ; IFS2
        .equ    TON, 15

        .bss
        .global _camera_next_byte, _camera_lines_left
_camera_next_byte:      .space 2
_camera_lines_left:     .space 2

        .text
        .global __T4Interrupt, __T5Interrupt
__T4Interrupt:
        push.s
        mov     RCOUNT, w2
        bclr    IFS1, #T4IF
        clr     TMR4                    ; the next one is CAMERA_SKIPPED_LINES + 1 lines away
        mov     _camera_next_byte, w1
        mov     #CAMERA_WIDTH, w3
        repeat  #2
        nop
1:      mov     PORTD, w0               ; Tcy 0 of a pixel
        swap    w0
        mov.b   w0, [w1++]
        repeat  #3
        nop
        mov     PORTD, w0               ; Tcy 8
        swap    w0
        mov.b   w0, [w1++]
        repeat  #16
        nop
        dec     w3, w3
        bra     nz, 1b
        mov     w1, _camera_next_byte
        mov     w2, RCOUNT
        dec     _camera_lines_left
        bra     nz, 2f
        bclr    T4CON, #TON
        bset    IFS2, #OC8IF            ; the frame is complete: notifies the kernel at IPL 4
2:      pop.s
        retfie

; The first VSYNC: from now on lines count. Flags of the interrupted code are in the hardware frame.
__T5Interrupt:
        bclr    IFS1, #T5IF
        bset    T4CON, #TON
        bclr    T5CON, #TON
        retfie
