"""Debugger words: program words that are not instructions and stop a debugger (isa.md §4.1)."""

from __future__ import annotations

from typing import Final

HALT: Final = 0xDA4000
"""Emitted after main() returns and in the default interrupt handler: stops the vendor's simulator."""
HOST_IO: Final = 0xDAC000
"""Emitted by the vendor library's file input and output stubs."""

FAILED_CHECK: Final = 0xDA4100
"""Base of the words 0..255 that the compiler places after HALT and RESET where a check of its sanitizer fails. They
distinguish this stop from an ordinary one and are never executed."""
PLAIN_TRAP: Final = 0xFF
"""Number of __builtin_trap(); the other numbers are those of clang."""


def is_debug_word(word: int) -> bool:
    """Return whether the emulator stops after `word` instead of resetting the device."""
    return word in (HALT, HOST_IO)
