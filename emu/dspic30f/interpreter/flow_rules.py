"""REPEAT, DO, RETFIE, DISI, skips and stalls (isa.md §7, §12, §13): one text for the sequencer, generated Python and
native code.

A rule gets and puts places of the record as device rules do (contract: emu/system/rules.py). Where ways part it asks
`m.is_true`; whoever writes code from it reads it once for each way (ways.py). The places hold what they held before the
rule until all of it is read. PC and the cycle are the engines': a rule returns what they need to know.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

from emu.dspic30f.isa.row import Insn
from emu.dspic30f.state.state import DA, DL_MASK, DL_SHIFT, FIRST, IPL3, LAST, MIDDLE, NOT_REPEATING, RA, State
from emu.system.rules import Cell, Number, cell_of

EDT_MATURE: Final = 3
"""`State.edt` from which the end test of a DO loop obeys: two instructions have completed since the one that wrote EDT,
so it was latched before the penultimate instruction (isa.md §7.6)."""
TAKEN: Final = 1
"""Cycles that a branch takes more if it is taken (isa.md §13.1)."""
SHADOWED: Final = 2
"""CORCON.DL of a loop inside of one whose registers are in the shadows (isa.md §2.6)."""


class StraightLineBuilder(Protocol):
    """What a rule without ways may do."""

    def get(self, place: Cell) -> Number:
        """The number at a place."""

    def put(self, place: Cell, value: Number) -> None:
        """Store the low bits of a number, once the whole rule has been read."""

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """`a` if `condition` else `b`."""


class FlowBuilder(StraightLineBuilder, Protocol):
    """What a rule of flow may do."""

    def is_true(self, condition: Number) -> bool:
        """Whether it is not 0, for an `if`."""


@dataclass(frozen=True, slots=True)
class FlowOperands:
    """Registers and cells of flow."""

    sr: Cell
    corcon: Cell
    rcount: Cell
    dcount: Cell
    disicnt: Cell
    disi_end: Cell
    repeat: Cell
    edt: Cell
    loop: tuple[Cell, ...]
    """DCOUNT, DOSTARTL, DOSTARTH, DOENDL, DOENDH."""
    shadow: tuple[Cell, ...]
    """Of those, in the same order."""


def operands_of(state: State) -> FlowOperands:
    """In the record of one CPU."""
    registers = ("SR", "CORCON", "RCOUNT", "DCOUNT", "DISICNT")
    cells = {name: cell_of(state.record, f"cpu.{name}") for name in ("disi_end", "repeat", "edt")}
    names = ("DCOUNT", "DOSTARTL", "DOSTARTH", "DOENDL", "DOENDH")
    return FlowOperands(
        **{name.lower(): Cell(2 * state.at[name], 16) for name in registers},
        **cells,
        loop=tuple(Cell(2 * state.at[name], 16) for name in names),
        shadow=tuple(cell_of(state.record, "cpu.do_shadow", number) for number in range(len(names))),
    )


def stall(written: Number, pointers: int) -> Number:
    """Whether an instruction starts a cycle late: the one before wrote, on its destination side, a register that this
    one takes as source pointer (isa.md §13.2). Both are masks, bit n for Wn."""
    return (written & pointers) != 0 if pointers else 0


def words_skipped(insn: Insn | None) -> int:
    """Words, and cycles, by which a skip passes over an instruction; what is none counts as one word (isa.md §7.3)."""
    return 1 if insn is None else insn.words


def repeat(m: FlowBuilder, p: FlowOperands, count: Number) -> bool:
    """REPEAT with that count has run: whether the next instruction is repeated; else it was a NOP (isa.md §7.5)."""
    m.put(p.rcount, count)
    if not m.is_true(count):
        return False
    m.put(p.sr, m.get(p.sr) | RA)
    m.put(p.repeat, FIRST)
    return True


def repeated(m: FlowBuilder, p: FlowOperands, counting: Number) -> bool:
    """An iteration of a REPEAT target has fallen through, with SR.RA set if `counting`: whether another follows. In the
    last one RA is 0 (isa.md §7.5)."""
    left = m.get(p.rcount)
    if m.is_true(left) and m.is_true(counting):
        if m.is_true(left != 1):
            m.put(p.repeat, MIDDLE)
        else:
            m.put(p.repeat, LAST)
            m.put(p.sr, m.get(p.sr) & (0xFFFF & ~RA))
        m.put(p.rcount, left - 1)
        return True
    m.put(p.repeat, NOT_REPEATING)
    m.put(p.sr, m.get(p.sr) & (0xFFFF & ~RA))
    return False


def repeating(m: StraightLineBuilder, p: FlowOperands, count: Number, left: Number) -> None:
    """What `repeat` by `count` and `repeated` have left before the iteration with RCOUNT = `left`, for code that counts
    elsewhere."""
    m.put(p.rcount, left)
    m.put(p.repeat, m.select(left == 0, LAST, m.select(left == count, FIRST, MIDDLE)))
    m.put(p.sr, m.get(p.sr) & (0xFFFF & ~RA) | m.select(left == 0, 0, RA))


def do(m: StraightLineBuilder, p: FlowOperands, count: Number, start: int, end: int) -> None:
    """DO has run: the loop from `start` to the instruction at `end`, with the one around it in the shadows (§7.6)."""
    for register, shadow in zip(p.loop, p.shadow, strict=True):
        m.put(shadow, m.get(register))
    for register, value in zip(p.loop, (count, start & 0xFFFF, start >> 16, end & 0xFFFF, end >> 16), strict=True):
        m.put(register, value)
    level = (m.get(p.corcon) & DL_MASK) >> DL_SHIFT
    _nest(m, p, m.select(level < 7, level + 1, 7))


def loop_again(m: FlowBuilder, p: FlowOperands) -> bool:
    """The instruction at DOEND has fallen through: whether the loop goes on at DOSTART, else it ends (isa.md §7.6)."""
    left = m.get(p.dcount)
    if m.is_true(left) and m.is_true(m.get(p.edt) < EDT_MATURE):
        m.put(p.dcount, left - 1)
        return True
    m.put(p.edt, 0)
    level = (m.get(p.corcon) & DL_MASK) >> DL_SHIFT
    if m.is_true(level == SHADOWED):
        for register, shadow in zip(p.loop, p.shadow, strict=True):
            m.put(register, m.get(shadow))
    _nest(m, p, level - 1 & 7)
    return False


def _nest(m: StraightLineBuilder, p: FlowOperands, level: Number) -> None:
    """Set CORCON.DL, and DA unless it is 0."""
    m.put(p.corcon, m.get(p.corcon) & (0xFFFF & ~DL_MASK) | level << DL_SHIFT)
    m.put(p.sr, m.get(p.sr) & (0xFFFF & ~DA) | m.select(level == 0, 0, DA))


def resume(m: StraightLineBuilder, p: FlowOperands, srl: Number, ipl3: Number) -> None:
    """RETFIE has popped SR<7:0> and IPL3 (isa.md §7.4): it goes on with the REPEAT that was interrupted."""
    m.put(p.sr, m.get(p.sr) & 0xFF00 | srl)
    m.put(p.corcon, m.get(p.corcon) & (0xFFFF & ~IPL3) | m.select(ipl3 != 0, IPL3, 0))
    m.put(p.repeat, m.select((srl & RA) != 0, FIRST, m.get(p.repeat)))


def disi(m: StraightLineBuilder, p: FlowOperands, count: int, after: Number) -> None:
    """DISI has run up to the cycle before `after`: its last cycle and the next `count` are blocked (isa.md §12)."""
    m.put(p.disi_end, after + count)
    m.put(p.disicnt, count)
