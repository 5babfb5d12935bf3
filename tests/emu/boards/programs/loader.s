; A boot loader on whichever UART speaks first, at 0.9 Mbaud. It answers every packet with one letter:
;   'F' address(3) data(96) sum    program a flash row and compare it with what was sent
;   'D' address(3) data(32) sum    the same for an EEPROM row
;   'G' address(3) sum             start what is there
; 'K' done, 'N' the sum of all bytes is not 0, 'V' the row reads differently.
; W13 UART, W12 sum, W8:W9 address, W10 next byte of the buffer.

        .equ    STA, 2
        .equ    TXREG, 4
        .equ    RXREG, 6
        .equ    FLASH_WORDS, 32
        .equ    EEPROM_WORDS, 16

        .section .nbss,bss,near
buffer: .space  96

        .text
        .global __reset
__reset:
        mov     #__SP_init, w15
        mov     #__SPLIM_init, w0
        mov     w0, SPLIM
        nop
        mov     #0x8000, w0
        mov     w0, U1MODE
        mov     w0, U2MODE
        mov     #0x0400, w0
        mov     w0, U1STA
        mov     w0, U2STA
listen: mov     #U1MODE, w13
        btsc    U1STA, #0
        bra     packet
        mov     #U2MODE, w13
        btss    U2STA, #0
        bra     listen

packet: clr     w12
        rcall   receive
        mov     w0, w7
        rcall   receive
        mov     w0, w8
        rcall   receive
        sl      w0, #8, w0
        ior     w8, w0, w8
        rcall   receive
        mov     w0, w9
        mov     w9, TBLPAG
        mov     #'G', w0
        cp      w7, w0
        bra     z, start
        mov     #'D', w0
        cp      w7, w0
        bra     z, eeprom

flash:  mov     #3*FLASH_WORDS, w4
        rcall   fill
        mov     #0x4041, w0
        rcall   erase
        mov     #FLASH_WORDS, w4
        mov     #buffer, w10
        mov     w8, w3
1:      tblwtl.b [w10++], [w3++]
        tblwtl.b [w10++], [w3--]
        tblwth.b [w10++], [w3++]
        inc     w3, w3
        dec     w4, w4
        bra     nz, 1b
        mov     #0x4001, w0
        rcall   operate
        mov     #FLASH_WORDS, w4
        mov     #buffer, w10
        mov     w8, w3
1:      tblrdl.b [w3++], w0
        cp.b    w0, [w10++]
        bra     nz, differs
        tblrdl.b [w3--], w0
        cp.b    w0, [w10++]
        bra     nz, differs
        tblrdh.b [w3++], w0
        cp.b    w0, [w10++]
        bra     nz, differs
        inc     w3, w3
        dec     w4, w4
        bra     nz, 1b
        bra     done

eeprom: mov     #2*EEPROM_WORDS, w4
        rcall   fill
        mov     #0x4045, w0
        rcall   erase
        mov     #buffer, w10
        mov     w8, w3
        repeat  #EEPROM_WORDS-1
        tblwtl  [w10++], [w3++]
        mov     #0x4005, w0
        rcall   operate
        mov     #buffer+2*EEPROM_WORDS, w10
        add     w8, #2*EEPROM_WORDS-2, w3
        add     w3, #2, w3
        mov     #EEPROM_WORDS, w4
1:      tblrdl  [--w3], w0
        cp      w0, [--w10]
        bra     nz, differs
        dec     w4, w4
        bra     nz, 1b
        bra     done

start:  clr     w4
        rcall   fill
        mov     #'K', w0
        rcall   send
1:      mov     [w13+STA], w0           ; the answer is out before the other program begins
        btss    w0, #8
        bra     1b
        push    w8
        push    w9
        return

; The data of a packet and its sum; a damaged packet does not come back.
fill:   mov     #buffer, w10
        cp0     w4
        bra     z, 2f
1:      rcall   receive
        mov.b   w0, [w10++]
        dec     w4, w4
        bra     nz, 1b
2:      rcall   receive
        cp0.b   w12
        bra     z, 3f
        sub     w15, #4, w15
        mov     #'N', w0
        bra     answer
3:      return

differs:
        mov     #'V', w0
        bra     answer
done:   mov     #'K', w0
answer: rcall   send
        bra     listen

receive:
        mov     [w13+STA], w0
        btss    w0, #0
        bra     receive
        clr     w0
        mov.b   [w13+RXREG], w0
        add     w12, w0, w12
        return

send:   mov     w0, [w13+TXREG]
        return

; Erase the row, then whatever NVMCON in W0 says to the row the last table write was for.
erase:  mov     w8, NVMADR
        mov     w9, NVMADRU
operate:
        mov     w0, NVMCON
        mov     #0x55, w1
        mov     w1, NVMKEY
        mov     #0xAA, w1
        mov     w1, NVMKEY
        bset    NVMCON, #15
        nop
        nop
1:      btsc    NVMCON, #15
        bra     1b
        return
