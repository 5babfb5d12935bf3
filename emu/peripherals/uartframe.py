"""Characters as levels on a wire: start bit, data, parity, stop bits, and what a sampling receiver sees (§10)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

PARITY_MARK: Final = 0x400
FRAMING_MARK: Final = 0x200
"""Errors of a received character, above its nine data bits."""


@dataclass(frozen=True, slots=True)
class Format:
    """PDSEL and STSEL of UxMODE."""

    pdsel: int
    stops: int

    @property
    def data_bits(self) -> int:
        """8, or 9 with PDSEL = 3."""
        return 9 if self.pdsel == 3 else 8

    @property
    def first_stop(self) -> int:
        """Index of the first stop bit in a frame."""
        return 1 + self.data_bits + (self.pdsel in (1, 2))

    @property
    def length(self) -> int:
        """Bits of a frame."""
        return self.first_stop + self.stops

    def parity(self, data: int) -> int | None:
        """Parity bit of a character, None without parity. PDSEL 1 = even, 2 = odd."""
        if self.pdsel in (0, 3):
            return None
        return (data & 0xFF).bit_count() + (self.pdsel == 2) & 1

    def pack(self, data: int) -> int:
        """Levels of a frame, start bit in bit 0."""
        bits = (data & (1 << self.data_bits) - 1) << 1
        parity = self.parity(data)
        if parity:
            bits |= 1 << self.first_stop - 1
        return bits | ((1 << self.stops) - 1) << self.first_stop

    def judge(self, sampled: int) -> int:
        """Data and error marks of a sampled frame. UNVERIFIED: with two stop bits the first one decides."""
        data = sampled >> 1 & (1 << self.data_bits) - 1
        parity = self.parity(data)
        marks = 0 if sampled >> self.first_stop & 1 else FRAMING_MARK
        if parity is not None and sampled >> self.first_stop - 1 & 1 != parity:
            marks |= PARITY_MARK
        return data | marks


FORMATS: Final = tuple(Format(pdsel, 1 + stsel) for pdsel in range(4) for stsel in range(2))
"""By PDSEL * 2 + STSEL."""


def sample(wave: int, length: int, offset: int, tick: int, bit_q8: int) -> int:
    """What a receiver with 16 clocks of `tick` Tcy per bit sees: the majority of clocks 7, 8 and 9 (§10.2).

    `offset`: Tcy from the start edge to the clock that detects it; `bit_q8`: the sender's bit time in Tcy/256.
    """
    sampled = 0
    for index in range(length):
        times = (offset + (16 * index + clock) * tick for clock in (7, 8, 9))
        votes = sum(wave >> min(time * 256 // bit_q8, length - 1) & 1 for time in times)
        sampled |= (votes >= 2) << index
    return sampled
