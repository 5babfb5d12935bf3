"""Boot loaders of the tinybld family and their block format.

The host sends 0xC1; the robot answers with its type and 'K'. A block has four bytes, the data of a row, and a byte that
makes the sum of all bytes 0 (mod 256). The robot answers 'K' when the row is written and 'N' if the sum is wrong.
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
"""PC units of a row."""
ROW_BYTES: Final = 3 * ROW_WORDS
"""Bytes of a row in a block: three for each word, the lowest first."""
BAUD: Final = 115_200
PATIENCE_SECONDS: Final = 1.4
"""Time without a byte after which a loader starts the program: 1 s by its comments, up to 1.4 s by its instructions."""

ADDRESS_ORDER: Final = "little"
"""UNVERIFIED on a robot: lowest byte first, by tinybld's source (its block is L, H, U, count). A loader with the
opposite order would take the lowest byte, a multiple of 0x40, as the page. That is never page 1, where loaders are. The
loader would stay intact, and the program would not start."""
_DATA_COMMAND: Final = ROW_BYTES
"""Fourth byte of a block with data. tinybld expects the number of bytes; the e-puck's variant checks only for
`_END_COMMAND`."""
_END_COMMAND: Final = 0xFF
_END_ADDRESS: Final = 1
"""The e-puck's loader lights an LED for some 13 ms times the low half of this value before it starts the program, and
for ever if the low half is 0."""


@dataclass(frozen=True, slots=True)
class Loader:
    """A boot loader in flash from `start` to the end.

    Word 0 jumps to the loader. It starts the program by a jump to `start` - 8, where the host has put the program's
    GOTO.
    """

    type: int
    """Its answer to HELLO."""
    name: str
    start: int
    """Program address of its first row."""

    @property
    def entry(self) -> int:
        """Address of the program's GOTO: two words, followed by two unused ones."""
        return self.start - 8

    @property
    def entry_row(self) -> int:
        """Address of the row with the entry. It precedes the loader; the image may use the rest of it."""
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
