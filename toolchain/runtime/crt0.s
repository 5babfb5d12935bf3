; SPDX-License-Identifier: MIT
; C start-up, abi-elf.md §3.1: stack, PSV window, initialised data, user_init, main; then the end of the program.
; exit_handlers.s includes this file, for programs that register functions with atexit.

        .section .init,code
        .global __reset
        .global __resetPRI
__reset:
__resetPRI:
        mov     #__SP_init,w15
        mov     #__SPLIM_init,w14
        mov     w14,_SPLIM
        nop                             ; a stack access must not directly follow a write to SPLIM
        rcall   __psv_init
        mov     #__dinit_tbloffset,w0
        mov     #__dinit_tblpage,w1
        rcall   __data_init
        mov     #__has_user_init,w0
        cp0     w0
        bra     z,1f
        call    __user_init
1:      call    _main

; exit(status), _Exit(status): the status is in W0 and, for debuggers, in __exit_status.
        .global _exit
        .global __Exit
_exit:
.ifdef EXIT_HANDLERS
        mov     w0,w8
        rcall   run_handlers
        mov     w8,w0
.endif
__Exit:
        mov     w0,__exit_status
        bset    _SR,#7                  ; IPL 7: only traps are served from here on (isa.md §2.3)
        bset    _SR,#6
        bset    _SR,#5
2:      btss    _U1STA,#8               ; sleep stops the UARTs: wait for their last characters (TRMT)
        bra     2b
3:      btss    _U2STA,#8
        bra     3b
4:      pwrsav  #0
        bra     4b

; Constants are read through the PSV window for the whole run (abi-elf.md §1.4).
        .global __psv_init
__psv_init:
        bclr    _CORCON,#2
        mov     #__const_length,w0
        cp0     w0
        bra     z,5f
        mov     #__const_psvpage,w0
        mov     w0,_PSVPAG
        bset    _CORCON,#2
5:      return

; Initialise RAM from the .dinit table (abi-elf.md §3.2). W1:W0 = program address of its first word.
        .global __data_init
__data_init:
        rcall   read_word
        mov     w5,w2                   ; destination; 0 ends the table
        cp0     w2
        bra     z,9f
        rcall   read_word
        mov     w5,w3                   ; length in bytes, even
        rcall   read_word
        and     w5,#3,w4                ; format
        bra     nz,copy_word
        lsr     w3,w3
        dec     w3,w3
        repeat  w3
        clr     [w2++]
        bra     __data_init

copy_word:                              ; 2 or, in format 2, 3 bytes from each program word
        mov     w1,_TBLPAG
        tblrdl.b [w0++],[w2++]
        tblrdl.b [w0--],[w2++]
        dec2    w3,w3
        bra     z,4f
        btss    w4,#1
        bra     4f
        tblrdh.b [w0],[w2++]
        dec     w3,w3
4:      rcall   advance
        cp0     w3
        bra     nz,copy_word_rest
        bra     __data_init

copy_word_rest:                         ; one byte is left after an upper byte
        cp      w3,#1
        bra     nz,copy_word
        mov     w1,_TBLPAG
        tblrdl.b [w0],[w2++]
        rcall   advance
        bra     __data_init

read_word:                              ; W5 = low 16 bits of the word at W1:W0
        mov     w1,_TBLPAG
        tblrdl  [w0],w5
advance:                                ; to the next program word, across a 64 K boundary too
        inc2    w0,w0
        addc    w1,#0,w1
9:      return

        .section .exit_status,persist,near
        .global __exit_status
        .align  2
__exit_status:
        .space  2
