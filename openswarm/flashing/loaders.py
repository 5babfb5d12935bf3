"""Boot loaders of the tinybld family and their block format.

The host sends 0xC1; the robot answers with its type and 'K'. A block has four bytes, the data of a row, and a byte that
makes the sum of all bytes 0 (mod 256). The robot answers 'K' after it has written the row, and 'N' if the sum is wrong.

Sources: tinybld's published code for the dsPIC (C. Chiculita) and the e-puck's variant of it; unverified on a robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

HELLO: Final = b"\xc1"
DONE: Final = b"K"
AGAIN: Final = b"N"
ROW_WORDS: Final = 32
ROW_UNITS: Final = 2 * ROW_WORDS
"""Size of a row in PC units."""
ROW_BYTES: Final = 3 * ROW_WORDS
"""Size of a row in a block in bytes: three for each word, the lowest first."""
BAUD: Final = 115_200
PATIENCE_SECONDS: Final = 1.4
"""Seconds without a byte after which a loader starts the program.

tinybld's comments say 1 s; its instructions take up to 1.4 s.
"""

ADDRESS_ORDER: Final = "little"
"""Byte order of the address in a block: lowest byte first. UNVERIFIED on a robot.

tinybld's source defines the block as L, H, U, count. A loader with the opposite order would take the lowest byte, a
multiple of 0x40, as the page. That is never page 1, which contains the loaders. The loader would stay intact, and
the program would not start.
"""
_DATA_COMMAND: Final = ROW_BYTES
"""Fourth byte of a block with data.

tinybld expects the number of bytes here; the e-puck's variant only compares it with `_END_COMMAND`.
"""
_END_COMMAND: Final = 0xFF
_END_ADDRESS: Final = 1
"""Address field of the end block; its low half must not be 0.

Before the e-puck's loader starts the program, it lights an LED for about 13 ms times this half; with 0, it never starts
the program.
"""


@dataclass(frozen=True, slots=True)
class Loader:
    """A boot loader that occupies flash from `start` to the end.

    Word 0 jumps to the loader. The loader starts the program by a jump to `start` - 8, where the host has put the
    program's GOTO.
    """

    type: int
    """Type byte of the loader's answer to HELLO."""
    name: str
    start: int
    """Program address of the loader's first row."""

    @property
    def entry(self) -> int:
        """Address of the program's GOTO, which has two words and is followed by two unused words."""
        return self.start - 8

    @property
    def entry_row(self) -> int:
        """Address of the row that contains the entry. It precedes the loader; the image may use the rest of the row."""
        return self.entry // ROW_UNITS * ROW_UNITS


LOADERS: Final = {
    loader.type: loader
    for loader in (
        Loader(0x71, "tinybld", 0x017F40),  # 96 words; dspic30f6014a.md §16
        Loader(0x91, "OpenSwarm's", 0x017E00),  # firmware/apps/boot/boot.h
    )
}


def block(address: int, words: list[int]) -> bytes:
    """Return the block that writes `ROW_WORDS` program words to the row at `address`."""
    body = address.to_bytes(3, ADDRESS_ORDER) + bytes([_DATA_COMMAND])
    body += b"".join(word.to_bytes(3, "little") for word in words)
    return body + bytes([-sum(body) & 0xFF])


def end() -> bytes:
    """Return the block that starts the program. The loader does not answer it."""
    return _END_ADDRESS.to_bytes(3, ADDRESS_ORDER) + bytes([_END_COMMAND])
