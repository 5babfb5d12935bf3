"""Assembly programs for robots, shared by several test files.

The fixture `assembled` turns a program into an image.
"""

from __future__ import annotations

BEGIN = """
        .include "p30F6014A.inc"
        .text
        .global _main
_main:  mov     #7, w0
        mov     w0, U1BRG               ; 115,200 baud (epuck.md)
        mov     #0x8000, w0
        mov     w0, U1MODE
        bset    U1STA, #10              ; UTXEN
"""
SEND_SELECTOR = """
        mov     PORTG, w0
        lsr     w0, #6, w0
        and     w0, #15, w0
        mov     #'A', w1
        add     w0, w1, w0
        mov     w0, U1TXREG
        mov     #10, w0
        mov     w0, U1TXREG
"""
"""Sends the selector position on RG6 to RG9 (epuck.md §2) as a letter from A, and a newline."""
REPEATING = """
9:      btss    U1STA, #0               ; URXDA
        bra     9b
        mov     U1RXREG, w0
        mov     w0, U1TXREG
        bra     9b
"""
ECHO = BEGIN + REPEATING
