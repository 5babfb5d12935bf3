; Prints a line four times on UART1, one character per T1 interrupt. For test_run.py.
        .equ    BRG, 7                  ; 14745600 / 16 / 115200 - 1
        .global _main, __T1Interrupt
        .section .const,psv,page
text:   .asciz  "hello from T1\r\n"
        .section .nbss,bss,near
next:   .space  2
        .section .ndata,data,near
count:  .word   3
        .text
_main:  mov     #BRG, w0
        mov     w0, U1BRG
        mov     #0x8000, w0
        mov     w0, U1MODE
        mov     #0x0400, w0
        mov     w0, U1STA
        mov     #psvoffset(text), w0
        mov     w0, next
        mov     #1500, w0
        mov     w0, PR1
        bset    IEC0, #3
        bset    T1CON, #15
1:      btss    count, #15
        bra     1b
        clr     w0
        return
__T1Interrupt:
        push.d  w0
        bclr    IFS0, #3
        mov     next, w0
        mov.b   [w0++], w1
        ze      w1, w1
        bra     z, 2f
        mov     w1, U1TXREG
        mov     w0, next
        bra     3f
2:      mov     #psvoffset(text), w0
        mov     w0, next
        dec     count
3:      pop.d   w0
        retfie
