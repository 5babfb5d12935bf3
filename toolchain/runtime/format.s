; SPDX-License-Identifier: MIT
; The core of the printf family (C11 7.21.6.1): int __format(sink_t *sink, const char *format, va_list arguments).
; It is in assembly to save stack: a call of snprintf with integer, string and character conversions takes 50 bytes with
; return address. 64-bit and floating conversions are C functions (format.h), linked if a format string needs them.
;
; W8 sink, W9 format, W10 arguments (va_arg subtracts first, abi-elf.md §2.4), W11 width, W12 precision, W13 = flags in
; the low byte (enum in format.h), conversion or prefix in the high byte, W14 digits or text.

        .equ    LEFT, 0
        .equ    PLUS, 1
        .equ    SPACE, 2
        .equ    ALTERNATE, 3
        .equ    ZERO, 4
        .equ    LONG, 5
        .equ    WIDE, 6
        .equ    BYTE, 7
        .equ    ROOM, 12                ; 32 bits in octal: 11 digits

        .section .note.bounds,info      ; LOOPS_OF of bounds.h
        .ascii  "loops format_digits 11@runtime/format.s:1\n"

        .section .text.___format,code
        .weak   ___format_wide
        .weak   ___format_double
        .global ___format
___format:
        mov.d   w8,[w15++]
        mov.d   w10,[w15++]
        mov.d   w12,[w15++]
        mov     w14,[w15++]
        mov     w0,w8
        mov     w1,w9
        mov     w2,w10
next:   ze      [w9++],w1
        bra     z,done
        mov     #'%',w2
        cp      w1,w2
        bra     z,flags_first
        rcall   format_put
        bra     next
done:   mov     [w8+6],w0               ; sink->count
        mov     [--w15],w14
        mov.d   [--w15],w12
        mov.d   [--w15],w10
        mov.d   [--w15],w8
        return

format_put:
        mov     w8,w0                   ; sink->put(sink, W1), as a tail call
        mov     [w8],w2
        goto    w2

fetch:  ze      [w9++],w1               ; next format character, less 0x20 to fit short literals
        sub     #0x20,w1
        return

flags_first:
        clr     w13
        clr     w11
        setm    w12
flags:  rcall   fetch
        cp      w1,#'-'-0x20
        bra     z,1f
        cp      w1,#'+'-0x20
        bra     z,2f
        cp0     w1
        bra     z,3f
        cp      w1,#'#'-0x20
        bra     z,4f
        cp      w1,#'0'-0x20
        bra     nz,width
        bset    w13,#ZERO
        bra     flags
1:      bset    w13,#LEFT
        bra     flags
2:      bset    w13,#PLUS
        bra     flags
3:      bset    w13,#SPACE
        bra     flags
4:      bset    w13,#ALTERNATE
        bra     flags

width:  cp      w1,#'*'-0x20
        bra     z,1f
        rcall   number
        mov     w2,w11
        bra     precision
1:      dec2    w10,w10
        mov     [w10],w11
        rcall   fetch
        btss    w11,#15
        bra     precision
        neg     w11,w11                 ; a negative width means the - flag
        bset    w13,#LEFT
precision:
        cp      w1,#'.'-0x20
        bra     nz,length
        rcall   fetch
        cp      w1,#'*'-0x20
        bra     z,1f
        rcall   number
        mov     w2,w12
        bra     length
1:      dec2    w10,w10
        mov     [w10],w12
        rcall   fetch

length: add     #0x20,w1
        mov     #'l',w2
        cp      w1,w2
        bra     nz,1f
        btsc    w13,#LONG
        bset    w13,#WIDE
        bset    w13,#LONG
        bra     4f
1:      mov     #'h',w2
        cp      w1,w2
        bra     nz,2f
        mov.b   [w9],w3
        cp.b    w3,w2
        bra     nz,4f
        bset    w13,#BYTE
        bra     4f
2:      mov     #'j',w2
        cp      w1,w2
        bra     nz,3f
        bset    w13,#WIDE
        bra     4f
3:      mov     #'z',w2
        cp      w1,w2
        bra     z,4f
        mov     #'t',w2
        cp      w1,w2
        bra     z,4f
        mov     #'L',w2
        cp      w1,w2
        bra     nz,conversion
4:      rcall   fetch
        bra     length

number: clr     w2                      ; read a decimal number at W1; W1 becomes its end
1:      sub     w1,#'0'-0x20,w3
        cp      w3,#10
        bra     geu,2f
        mul.uu  w2,#10,w4
        add     w4,w3,w2
        rcall   fetch
        bra     1b
2:      return

conversion:
        cp0     w1
        bra     z,done
        sl      w1,#8,w2
        ior     w13,w2,w13
        mov     #10,w4
        mov     #'d',w2
        cp      w1,w2
        bra     z,signed
        mov     #'i',w2
        cp      w1,w2
        bra     z,signed
        mov     #'u',w2
        cp      w1,w2
        bra     z,unsigned
        mov     #'s',w2
        cp      w1,w2
        bra     z,string
        mov     #'c',w2
        cp      w1,w2
        bra     z,character
        mov     #8,w4
        mov     #'o',w2
        cp      w1,w2
        bra     z,unsigned
        mov     #16,w4
        ior     #0x20,w1                ; convert X to x, E to e
        mov     #'x',w2
        cp      w1,w2
        bra     z,unsigned
        mov     #'p',w2
        cp      w1,w2
        bra     z,pointer
        mov     #'e',w2
        sub     w1,w2,w2
        cp      w2,#2                   ; e f g
        bra     leu,floating
        lsr     w13,#8,w1
        mov     #'n',w2
        cp      w1,w2
        bra     z,count
        rcall   format_put                     ; print any other character
        bra     next

count:  dec2    w10,w10                 ; number of characters so far, in the size of the length modifier
        mov     [w10],w3
        mov     [w8+6],w0
        btsc    w13,#BYTE
        bra     1f
        mov     w0,[w3++]
        btsc    w13,#WIDE
        bra     2f
        clr     w1
        btsc    w13,#LONG
        mov     w1,[w3]
        bra     next
1:      mov.b   w0,[w3]
        bra     next
2:      clr     w1
        mov     w1,[w3++]
        mov     w1,[w3++]
        mov     w1,[w3]
        bra     next

pointer:
        bset    w13,#ALTERNATE
        bset    w13,#11                 ; 'p' | 8 = 'x'
unsigned:
        bclr    w13,#PLUS
        bclr    w13,#SPACE
        btsc    w13,#WIDE
        bra     wide_unsigned
        dec2    w10,w10
        btss    w13,#LONG
        bra     1f
        dec2    w10,w10
        mov     [w10],w0
        mov     [w10+2],w1
        bra     2f
1:      mov     [w10],w0
        btsc    w13,#BYTE
        ze      w0,w0
        clr     w1
2:      clr     w2                      ; prefix: the x of 0x, unless the value is 0
        cp      w4,#16
        bra     nz,integer
        btss    w13,#ALTERNATE
        bra     integer
        ior     w0,w1,w3
        bra     z,integer
        lsr     w13,#8,w2
        bra     integer

signed: btsc    w13,#WIDE
        bra     wide_signed
        dec2    w10,w10
        btss    w13,#LONG
        bra     1f
        dec2    w10,w10
        mov     [w10],w0
        mov     [w10+2],w1
        bra     2f
1:      mov     [w10],w0
        btsc    w13,#BYTE
        se      w0,w0
        asr     w0,#15,w1
2:      clr     w2                      ; prefix: sign
        btsc    w13,#SPACE
        mov     #' ',w2
        btsc    w13,#PLUS
        mov     #'+',w2
        cp0     w1
        bra     nn,integer
        subr    w0,#0,w0
        subbr   w1,#0,w1
        mov     #'-',w2

; W1:W0 in base W4 with prefix W2: a sign, or x or X for 0x.
integer:
        mov     [w15+ROOM],w14          ; traps here if the stack is too short (-fstack-check)
        add     w15,#ROOM,w15
        sub     w15,#ROOM,w14
        lsr     w13,#8,w5               ; distance from 10 to the letter of this conversion
        and     #0x20,w5
        add     #'A'-10,w5
        ze      w13,w13
        sl      w2,#8,w2
        ior     w13,w2,w13
        ior     w0,w1,w2
        bra     nz,format_digits
        cp0     w12
        bra     z,4f                    ; with precision 0, the value 0 has no digits
        mov     #'0',w1
        mov.b   w1,[w14++]
        bra     5f
format_digits:
        mov     w0,w3                   ; divide: high word, then remainder and low word
        repeat  #17
        div.uw  w1,w4
        mov     w0,w2
        mov     w3,w0
        repeat  #17
        div.ud  w0,w4
        cp      w1,#10
        bra     ltu,3f
        add     w1,w5,w1
        sub     #'0',w1
3:      add     #'0',w1
        mov.b   w1,[w14++]
        mov     w2,w1
        ior     w0,w1,w2
        bra     nz,format_digits
4:      btss    w13,#ALTERNATE          ; # of octal: a leading 0
        bra     5f
        cp      w4,#8
        bra     nz,5f
        mov     #'0',w1
        mov.b   w1,[w14++]

5:      sub     w15,#ROOM,w0
        sub     w14,w0,w0               ; digits
        sub     w12,w0,w2               ; zeros up to the precision
        btsc    w2,#15
        clr     w2
        sub     w11,w0,w11
        lsr     w13,#8,w1
        bra     z,6f
        dec     w11,w11                 ; sign
        btsc    w1,#6
        dec     w11,w11                 ; or 0x
6:      btss    w13,#ZERO
        bra     7f
        btss    w12,#15                 ; the 0 flag applies without precision and without -
        bra     7f
        btsc    w13,#LEFT
        bra     7f
        mov     w11,w2
        btsc    w2,#15
        clr     w2
7:      mov     w2,w12
        sub     w11,w12,w11             ; number of spaces
        btss    w13,#LEFT
        rcall   pad
        lsr     w13,#8,w1
        bra     z,9f
        btss    w1,#6
        bra     8f
        mov     #'0',w1
        rcall   format_put
        lsr     w13,#8,w1
8:      rcall   format_put
9:      dec     w12,w12
        bra     n,10f
        mov     #'0',w1
        rcall   format_put
        bra     9b
10:     sub     w15,#ROOM,w0
        cp      w14,w0
        bra     z,11f
        ze      [--w14],w1
        rcall   format_put
        bra     10b
11:     btsc    w13,#LEFT
        rcall   pad
        sub     w15,#ROOM,w15
        bra     next

pad:    dec     w11,w11                 ; W11 spaces, none if negative
        bra     n,1f
        mov     #' ',w1
        rcall   format_put
        bra     pad
1:      return

string: dec2    w10,w10
        mov     [w10],w14
        mov     w14,w3
        clr     w2
1:      cp      w2,w12                  ; without precision it is 0xFFFF, more than any length
        bra     z,text
        cp0.b   [w3++]
        bra     z,text
        inc     w2,w2
        bra     1b
character:
        dec2    w10,w10
        mov     w10,w14                 ; the argument itself is the text
        mov     #1,w2
text:   mov     w2,w12                  ; W12 characters from W14 in a field of W11
        sub     w11,w12,w11
        btss    w13,#LEFT
        rcall   pad
1:      dec     w12,w12
        bra     n,2f
        ze      [w14++],w1
        rcall   format_put
        bra     1b
2:      btsc    w13,#LEFT
        rcall   pad
        bra     next

wide_unsigned:
        rcall   argument64
        bra     2f
wide_signed:
        rcall   argument64
        btss    w7,#15
        bra     2f
        subr    w4,#0,w4
        subbr   w5,#0,w5
        subbr   w6,#0,w6
        subbr   w7,#0,w7
        mov     #1,w2                   ; negative
        bra     3f
2:      clr     w2
3:      mov     #handle(___format_wide),w3
        bra     large
floating:
        .ifdef SHORT_DOUBLE             ; -fshort-double: the argument has 32 bits
        sub     w10,#4,w10
        mov.d   [w10],w0
        call    ___extendsfdf2
        mov.d   w0,w4
        mov.d   w2,w6
        .else
        rcall   argument64
        .endif
        mov     #handle(___format_double),w3
large:  cp0     w3                      ; null if not linked: the format was built at run time
        bra     z,next
        mov     w13,[w15++]             ; a spec_t
        mov     w11,[w15++]
        mov     w12,[w15++]
        mov     w8,w0
        sub     w15,#6,w1
        call    w3
        sub     w15,#6,w15
        bra     next

argument64:
        sub     w10,#8,w10
        mov.d   [w10],w4
        add     w10,#4,w3
        mov.d   [w3],w6
        return
