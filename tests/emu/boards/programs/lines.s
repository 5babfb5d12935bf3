; One line of the picture: 8 Tcy per byte on the bus, first read of PORTD in the 11th Tcy of the handler (epuck.md §7.5).
        .text
        .global __T4Interrupt
__T4Interrupt:
        push.s
        bclr    IFS1, #5
        clr     TMR4
        mov     #_pattern, w0
        mov     _cursor, w1
        mov     #1, w2
        nop
next:   cp.b    w2, [w0++]
        bra     z, take
        bra     ltu, done
        nop
        nop
        nop
        bra     next
take:   mov     PORTD, w3
        lsr     w3, #8, w3
        mov.b   w3, [w1++]
        bra     next
done:   mov     w1, _cursor
        dec     _lines_left
        bra     nz, leave
        bclr    T4CON, #15
        bclr    IEC1, #5
leave:  pop.s
        retfie
