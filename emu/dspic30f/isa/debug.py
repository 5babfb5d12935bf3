"""Words that mean something to a debugger only and are no instructions (isa.md §4.1)."""

from __future__ import annotations

from typing import Final

HALT: Final = 0xDA4000
"""Emitted after main() returns and in the default interrupt handler: stops the vendor's simulator."""
HOST_IO: Final = 0xDAC000
"""Emitted by the vendor library's file input and output stubs."""


def is_debug_word(word: int) -> bool:
    """Whether the emulator stops behind `word` instead of resetting."""
    return word in (HALT, HOST_IO)
