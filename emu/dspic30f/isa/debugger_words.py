"""Debugger words: program words that are not instructions and make a debugger stop (isa.md §4.1)."""

from __future__ import annotations

from typing import Final

HALT: Final = 0xDA4000
"""Word after the call of main() and in the default interrupt handler; it halts the vendor's simulator."""
HOST_IO: Final = 0xDAC000
"""Word in the vendor library's stubs for file input and output."""

FAILED_CHECK: Final = 0xDA4100
"""First of the 256 words that the compiler places after HALT and RESET where a check of its sanitizer fails.

They distinguish this stop from an ordinary one and are never executed.
"""
PLAIN_TRAP: Final = 0xFF
"""Check number of __builtin_trap(); the other numbers are clang's."""


def is_debug_word(word: int) -> bool:
    """Return whether the emulator stops after executing `word` instead of resetting the device."""
    return word in (HALT, HOST_IO)
