"""Words that mean something to a debugger only and are no instructions (isa.md §4.1)."""

from __future__ import annotations

from typing import Final

HALT: Final = 0xDA4000
"""Emitted after main() returns and in the default interrupt handler: stops the vendor's simulator."""
HOST_IO: Final = 0xDAC000
"""Emitted by the vendor library's file input and output stubs."""

FAILED_CHECK: Final = 0xDA4100
"""Plus a number below 256: our compiler puts it behind HALT and a RESET where a check of its sanitizer fails, so that
the stop can be told from an ordinary one. It is never executed."""
PLAIN_TRAP: Final = 0xFF
"""The number for __builtin_trap(); the others are clang's."""


def is_debug_word(word: int) -> bool:
    """Whether the emulator stops behind `word` instead of resetting."""
    return word in (HALT, HOST_IO)
