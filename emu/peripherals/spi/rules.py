"""What an SPI module does (§12): text for every engine; around it `spi.py` asks who is at the other end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from emu.system.events import NEVER
from emu.system.rules import Line, Number, Place, Reader, Slot, request

_PRIMARY: Final = (64, 16, 4, 1)
"""Primary prescale for PPRE = 0..3; the secondary is 8 - SPRE (§12)."""


@dataclass(frozen=True, slots=True)
class SpiOperands:
    """Registers and cells of one module."""

    stat: Place
    con: Place
    buf: Place
    bit: Mapping[str, int]
    """Masks of the fields of SPIxSTAT and SPIxCON, which have different names."""
    spre: int
    """Its lowest bit; PPRE is in bits 1:0."""
    waiting: Place
    shift: Place
    received: Place
    busy: Place
    start: Place
    bit_tcy: Place
    answered: Place
    """Whether there is a device at the other end that must be asked."""
    level: Place
    """Of the port of SDI."""
    sdi: int
    step: Slot
    line: Line


def word_bits(m: Reader, s: SpiOperands) -> Number:
    """8 or 16 (MODE16)."""
    return m.select((m.get(s.con) & s.bit["MODE16"]) != 0, 16, 8)


def bit_time(m: Reader, s: SpiOperands) -> Number:
    """Length of a bit as master in Tcy: primary x secondary prescale (§12)."""
    con = m.get(s.con)
    return m.table(_PRIMARY, con & 3) * (8 - (con >> s.spre & 7))


def _word(m: Reader, s: SpiOperands, number: Number) -> Number:
    return m.select((m.get(s.con) & s.bit["MODE16"]) != 0, number & 0xFFFF, number & 0xFF)


def push(m: Reader, s: SpiOperands, value: Number, lanes: int) -> bool:
    """BUF written; a word written while TXB is full is lost (§12)."""
    stat, busy, due = m.get(s.stat), m.get(s.busy) != 0, m.get(s.step.due)
    word = (m.get(s.buf) & (0xFFFF & ~lanes)) | (value & lanes)
    taken = (stat & (s.bit["SPIEN"] | s.bit["SPITBF"])) == s.bit["SPIEN"]
    starts = taken & ((m.get(s.con) & s.bit["MSTEN"]) != 0) & (busy == 0)
    m.put(s.buf, word)
    m.put(s.waiting, m.select(taken, word, m.get(s.waiting)))
    m.put(s.stat, stat | m.select(taken, s.bit["SPITBF"], 0))
    m.post(s.step, m.select(starts, m.now + 1, due))
    return True


def take(m: Reader, s: SpiOperands) -> Number:
    """BUF read: RXB is empty."""
    m.put(s.stat, m.get(s.stat) & (0xFFFF & ~s.bit["SPIRBF"]))
    return m.get(s.received)


def begin(m: Reader, s: SpiOperands, cycle: Number, bit: Number, when: Number = True) -> None:
    """`when` that holds: TXB moves to the shift register, which is clocked from `cycle` on."""
    stat, shift = m.get(s.stat), m.get(s.shift)
    waits = when & ((stat & s.bit["SPITBF"]) != 0)
    m.put(s.shift, m.select(waits, _word(m, s, m.get(s.waiting)), shift))
    m.put(s.stat, stat & (0xFFFF & ~m.select(waits, s.bit["SPITBF"], 0)))
    for place, value in ((s.busy, 1), (s.start, cycle), (s.bit_tcy, bit)):
        m.put(place, m.select(when, value, m.get(place)))
    m.post(s.step, m.select(when, cycle + word_bits(m, s) * bit, NEVER))


def finish(m: Reader, s: SpiOperands, number: Number, when: Number = True) -> None:
    """`when` that holds: a word has been exchanged for the low bits of `number`; one that finds RXB full is lost."""
    word, stat = _word(m, s, number), m.get(s.stat)
    told = when & ((stat & s.bit["SPIROV"]) == 0)
    full = (stat & s.bit["SPIRBF"]) != 0
    m.put(s.shift, m.select(when, word, m.get(s.shift)))
    m.put(s.busy, m.select(when, 0, m.get(s.busy)))
    m.put(s.received, m.select(told & (full == 0), word, m.get(s.received)))
    m.put(s.stat, stat | m.select(told, m.select(full, s.bit["SPIROV"], s.bit["SPIRBF"]), 0))
    request(m, s.line, m.now, told)


def open_end(m: Reader, s: SpiOperands) -> Number:
    """What a master reads where nobody is: the level of SDI in every bit."""
    return m.select((m.get(s.level) & s.sdi) != 0, 0xFFFF, 0)


def waits_to_begin(m: Reader, s: SpiOperands) -> Number:
    """Truth of "a master that rests has a word in TXB"."""
    return ((m.get(s.con) & s.bit["MSTEN"]) != 0) & ((m.get(s.stat) & s.bit["SPITBF"]) != 0) & (m.get(s.busy) == 0)


def fire(m: Reader, s: SpiOperands) -> None:
    """A master's word has ended, and the next one begins."""
    m.need(((m.get(s.con) & s.bit["MSTEN"]) != 0) & (m.get(s.answered) == 0))
    finish(m, s, open_end(m, s), m.get(s.busy) != 0)
    begin(m, s, m.now, bit_time(m, s), waits_to_begin(m, s))
