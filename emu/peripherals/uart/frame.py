"""UART frames as bit patterns: start bit, data, parity, stop bits, and how a receiver samples them (§10).

The functions are rules (emu/system/rules.py) that use only operators. `mode` is UxMODE, whose bits 2:0 are PDSEL and
STSEL.
"""

from __future__ import annotations

from typing import Final

from emu.system.rules import Number

PARITY_MARK: Final = 0x400
FRAMING_MARK: Final = 0x200
"""Error bits of a received character, above its nine data bits."""


def is_nine(mode: Number) -> Number:
    """Return whether a frame has nine data bits and no parity (PDSEL = 3)."""
    return (mode & 6) == 6


def has_parity(mode: Number) -> Number:
    """Return whether a frame has a parity bit: PDSEL = 1 (even) or 2 (odd)."""
    return ((mode & 6) == 2) | ((mode & 6) == 4)


def data_of(mode: Number, word: Number) -> Number:
    """Return the 8 or 9 data bits of a word."""
    return word & (0xFF | is_nine(mode) << 8)


def first_stop(mode: Number) -> Number:
    """Return the index of the first stop bit in a frame."""
    return ((mode & 6) != 0) + 9


def stops(mode: Number) -> Number:
    """Return the number of stop bits, 1 or 2 (STSEL)."""
    return (mode & 1) + 1


def length(mode: Number) -> Number:
    """Return the number of bits in a frame."""
    return first_stop(mode) + stops(mode)


def parity(mode: Number, data: Number) -> Number:
    """Return the parity bit of a character; 0 without parity."""
    nibbles = (data ^ data >> 4) & 0xF
    pairs = nibbles ^ nibbles >> 2
    return (((mode & 6) == 4) ^ (pairs ^ pairs >> 1) & 1) & has_parity(mode)


def pack(mode: Number, word: Number) -> Number:
    """Return the levels of a frame; bit 0 is the start bit."""
    data = data_of(mode, word)
    return data << 1 | parity(mode, data) << 9 | (1 | (mode & 1) << 1) << first_stop(mode)


def unpack(mode: Number, sampled: Number) -> Number:
    """Return data and error bits of a sampled frame. UNVERIFIED: of two stop bits only the first is checked."""
    data = data_of(mode, sampled >> 1)
    broken = (sampled >> first_stop(mode) & 1) ^ 1
    wrong = (parity(mode, data) ^ sampled >> 9 & 1) & has_parity(mode)
    return data | broken * FRAMING_MARK | wrong * PARITY_MARK


def sample(wave: int, bits: int, offset: int, tick: int, bit_q8: int) -> int:
    """Return the bits that a receiver samples: the majority of clocks 7, 8 and 9 of the 16 per bit (§10.2).

    `bits`: length of the frame; `tick`: Tcy per receiver clock; `offset`: Tcy from the start edge to the receiver clock
    that detects it; `bit_q8`: the sender's bit time in Tcy/256.
    """
    sampled = 0
    for index in range(bits):
        times = (offset + (16 * index + clock) * tick for clock in (7, 8, 9))
        votes = sum(wave >> min(time * 256 // bit_q8, bits - 1) & 1 for time in times)
        sampled |= (votes >= 2) << index
    return sampled
