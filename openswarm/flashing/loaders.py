"""Boot loaders of tinybld's kind, and the blocks that they take. A leaf beside the chip's numbers.

The host says 0xC1, the robot its type and 'K'. A block is four bytes, the data of a row, and a byte that makes the sum
of all of them 0 (mod 256); the robot answers 'K' when the row is written and 'N' when the sum was wrong. This is how
tinybld's published source for the dsPIC (C. Chiculita) and the e-puck's variant of it read; no robot was asked.
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
"""Of a row on its way: three for each word, the lowest first."""
BAUD: Final = 115_200
PATIENCE_SECONDS: Final = 1.4
"""A loader that hears nothing for so long gives up and starts the program: 1 s by its comments, up to 1.4 s by the
instructions of its loop."""

ADDRESS_ORDER: Final = "little"
"""UNVERIFIED on a robot: lowest byte first, as tinybld's source says (its block is L, H, U, count). To a loader that
read the other way the lowest byte, a multiple of 0x40, would be the page: never page 1, where loaders lie. It could
not be harmed, and the program would not start."""
_DATA_COMMAND: Final = ROW_BYTES
"""Fourth byte of a block with data. tinybld wants the number of bytes there, the e-puck's variant only looks for
`_END_COMMAND`."""
_END_COMMAND: Final = 0xFF
_END_ADDRESS: Final = 1
"""The e-puck's loader shows an LED for some 13 ms times the low half of this before it starts the program, and for ever
if that is 0."""


@dataclass(frozen=True, slots=True)
class Loader:
    """A boot loader that lies in flash from `start` to the end. Word 0 leads to it, and it starts the program with a
    jump to `start` - 8, where the host has put the program's own GOTO."""

    type: int
    """What it answers to HELLO."""
    name: str
    start: int
    """Program address of its first row."""

    @property
    def entry(self) -> int:
        """Where the program's GOTO belongs: two words, and two that are not used."""
        return self.start - 8

    @property
    def entry_row(self) -> int:
        """The row of the entry. Before the loader, and the image may fill the rest of it."""
        return self.entry // ROW_UNITS * ROW_UNITS


LOADERS: Final = {
    loader.type: loader
    for loader in (
        Loader(0x71, "tinybld", 0x017F40),  # 96 words; dspic30f6014a.md §16
        Loader(0x91, "OpenSwarm's", 0x017E00),  # firmware/apps/boot/boot.h
    )
}


def block(address: int, words: list[int]) -> bytes:
    """A row of `ROW_WORDS` program words for the row at `address`."""
    body = address.to_bytes(3, ADDRESS_ORDER) + bytes([_DATA_COMMAND])
    body += b"".join(word.to_bytes(3, "little") for word in words)
    return body + bytes([-sum(body) & 0xFF])


def end() -> bytes:
    """Start the program. There is no answer."""
    return _END_ADDRESS.to_bytes(3, ADDRESS_ORDER) + bytes([_END_COMMAND])
