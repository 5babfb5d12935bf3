"""Rules of an SPI module (§12). `spi.py` handles transfers with a connected device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from emu.system.events import NEVER
from emu.system.rules import Cell, EventSlot, InterruptLine, Number, RuleBuilder, request

_PRIMARY: Final = (64, 16, 4, 1)
"""Primary prescale ratio for PPRE = 0..3; the secondary ratio is 8 - SPRE (§12)."""


@dataclass(frozen=True, slots=True)
class SpiOperands:
    """Operands of the rules: registers and cells of one SPI module."""

    stat: Cell
    con: Cell
    buf: Cell
    bit: Mapping[str, int]
    """Masks of the fields of SPIxSTAT and SPIxCON, which have different names."""
    spre: int
    """Bit position of SPRE in SPIxCON; PPRE is in bits 1:0."""
    waiting: Cell
    shift: Cell
    received: Cell
    busy: Cell
    start: Cell
    bit_tcy: Cell
    has_device: Cell
    """Whether a device is connected, for which Python must be called."""
    level: Cell
    """Pin levels of the port that has SDI."""
    sdi: int
    logged: Cell
    """Whether edges of pins are logged."""
    step: EventSlot
    line: InterruptLine


def word_bits(m: RuleBuilder, s: SpiOperands) -> Number:
    """Return the word length in bits, 8 or 16 (MODE16)."""
    return m.select((m.get(s.con) & s.bit["MODE16"]) != 0, 16, 8)


def bit_time(m: RuleBuilder, s: SpiOperands) -> Number:
    """Return the bit time as master in Tcy: primary x secondary prescale (§12)."""
    con = m.get(s.con)
    return m.table(_PRIMARY, con & 3) * (8 - (con >> s.spre & 7))


def _word(m: RuleBuilder, s: SpiOperands, number: Number) -> Number:
    return m.select((m.get(s.con) & s.bit["MODE16"]) != 0, number & 0xFFFF, number & 0xFF)


def push(m: RuleBuilder, s: SpiOperands, value: Number, lanes: int) -> bool:
    """Write BUF. A word written while TXB is full is lost (§12)."""
    stat, busy, due = m.get(s.stat), m.get(s.busy) != 0, m.get(s.step.due)
    word = (m.get(s.buf) & (0xFFFF & ~lanes)) | (value & lanes)
    taken = (stat & (s.bit["SPIEN"] | s.bit["SPITBF"])) == s.bit["SPIEN"]
    starts = taken & ((m.get(s.con) & s.bit["MSTEN"]) != 0) & (busy == 0)
    m.put(s.buf, word)
    m.put(s.waiting, m.select(taken, word, m.get(s.waiting)))
    m.put(s.stat, stat | m.select(taken, s.bit["SPITBF"], 0))
    m.post(s.step, m.select(starts, m.now + 1, due))
    return True


def read_buffer(m: RuleBuilder, s: SpiOperands) -> Number:
    """Read BUF, which empties RXB."""
    m.put(s.stat, m.get(s.stat) & (0xFFFF & ~s.bit["SPIRBF"]))
    return m.get(s.received)


def begin(m: RuleBuilder, s: SpiOperands, cycle: Number, bit: Number, when: Number = True) -> None:
    """If `when` holds, start a transfer: move TXB to the shift register, which is clocked from `cycle` on."""
    stat, shift = m.get(s.stat), m.get(s.shift)
    waits = when & ((stat & s.bit["SPITBF"]) != 0)
    m.put(s.shift, m.select(waits, _word(m, s, m.get(s.waiting)), shift))
    m.put(s.stat, stat & (0xFFFF & ~m.select(waits, s.bit["SPITBF"], 0)))
    for place, value in ((s.busy, 1), (s.start, cycle), (s.bit_tcy, bit)):
        m.put(place, m.select(when, value, m.get(place)))
    m.post(s.step, m.select(when, cycle + word_bits(m, s) * bit, NEVER))


def finish(m: RuleBuilder, s: SpiOperands, number: Number, when: Number = True) -> None:
    """If `when` holds, complete a transfer that received the low bits of `number`. They are lost if RXB is full."""
    word, stat = _word(m, s, number), m.get(s.stat)
    is_new = when & ((stat & s.bit["SPIROV"]) == 0)
    full = (stat & s.bit["SPIRBF"]) != 0
    m.put(s.shift, m.select(when, word, m.get(s.shift)))
    m.put(s.busy, m.select(when, 0, m.get(s.busy)))
    m.put(s.received, m.select(is_new & (full == 0), word, m.get(s.received)))
    m.put(s.stat, stat | m.select(is_new, m.select(full, s.bit["SPIROV"], s.bit["SPIRBF"]), 0))
    request(m, s.line, m.now, is_new)


def undriven_word(m: RuleBuilder, s: SpiOperands) -> Number:
    """Return the word that a master receives from SDI without a connected device: every bit is the pin's level."""
    return m.select((m.get(s.level) & s.sdi) != 0, 0xFFFF, 0)


def waits_to_begin(m: RuleBuilder, s: SpiOperands) -> Number:
    """Whether an idle master has a word in TXB."""
    return ((m.get(s.con) & s.bit["MSTEN"]) != 0) & ((m.get(s.stat) & s.bit["SPITBF"]) != 0) & (m.get(s.busy) == 0)


def fire(m: RuleBuilder, s: SpiOperands) -> None:
    """Handle the end of a word sent by a master, and start the next one."""
    m.require(((m.get(s.con) & s.bit["MSTEN"]) != 0) & (m.get(s.has_device) == 0))
    m.require(m.get(s.logged) == 0)
    finish(m, s, undriven_word(m, s), m.get(s.busy) != 0)
    begin(m, s, m.now, bit_time(m, s), waits_to_begin(m, s))
