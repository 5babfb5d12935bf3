; SPDX-License-Identifier: MIT
; atexit (C11 7.22.4.2), and start-up code whose exit calls the registered functions, the last one first. The linker uses
; it instead of crt0.s, which calls no handlers, if a program uses atexit (link/resolve.py).

        .equ    EXIT_HANDLERS,1
        .include "crt0.s"

        .equ    MOST,32                 ; C11 7.22.4.2p3
        .section .exit_handlers,bss
        .align  2
count:  .space  2
handlers:
        .space  2*MOST

        .section .text._atexit,code
        .global _atexit
_atexit:                                ; int atexit(void (*handler)(void)): 0, or 1 if the table is full
        mov     #count,w1
        mov     #MOST,w3
        mov     [w1],w2
        cp      w2,w3
        bra     geu,1f
        inc     [w1],[w1++]
        sl      w2,w2
        add     w2,w1,w1
        mov     w0,[w1]
        retlw   #0,w0
1:      retlw   #1,w0

        .section .text.run_handlers,code
run_handlers:                           ; call all handlers; a handler may register more
1:      mov     #count,w1
        mov     [w1],w2
        cp0     w2
        bra     z,2f
        dec     w2,[w1]
        sl      w2,w2                   ; handlers[count - 1] = count + 2 * old count
        add     w2,w1,w1
        mov     [w1],w0
        call    w0
        bra     1b
2:      return
