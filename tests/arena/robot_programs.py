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
REPEATING = """
9:      btss    U1STA, #0               ; URXDA
        bra     9b
        mov     U1RXREG, w0
        mov     w0, U1TXREG
        bra     9b
"""
ECHO = BEGIN + REPEATING
