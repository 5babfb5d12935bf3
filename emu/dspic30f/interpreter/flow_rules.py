"""Rules of REPEAT, DO, RETFIE, DISI, skips and stalls (isa.md §7, §12, §13), shared by the sequencer and native code.

A rule reads and writes cells of the record, as device rules do (contract: emu/system/rules.py). It may branch on
`m.is_true`; a code generator then evaluates the rule once for each path (rule_paths.py). A cell keeps its old value
until the whole rule has been evaluated. The engines maintain PC and the cycle; a rule returns what they need.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

from emu.dspic30f.isa.row import Insn
from emu.dspic30f.state.state import DA, DL_MASK, DL_SHIFT, FIRST, IPL3, LAST, MIDDLE, NOT_REPEATING, RA, State
from emu.system.rules import Cell, Number, cell_of

EDT_MATURE: Final = 3
"""Minimum `State.edt` for which the end test of a DO loop applies EDT. Two instructions have then completed since the
write of EDT, so it was latched before the penultimate instruction (isa.md §7.6)."""
TAKEN: Final = 1
"""Number of additional cycles of a taken branch (isa.md §13.1)."""
SHADOWED: Final = 2
"""CORCON.DL in the inner of two nested loops; the shadow registers hold the outer one's registers (isa.md §2.6)."""


class StraightLineBuilder(Protocol):
    """Builder operations of a rule without branches."""

    def get(self, cell: Cell) -> Number:
        """Return the number in a cell."""

    def put(self, cell: Cell, value: Number) -> None:
        """Store the low bits of a number in a cell, after the whole rule has been evaluated."""

    def select(self, condition: Number, a: Number, b: Number) -> Number:
        """Return `a` if `condition` is not 0, else `b`."""


class FlowBuilder(StraightLineBuilder, Protocol):
    """Builder operations of a flow rule."""

    def is_true(self, condition: Number) -> bool:
        """Return whether `condition` is not 0, for use in an `if`."""


@dataclass(frozen=True, slots=True)
class FlowOperands:
    """Registers and cells that flow rules access."""

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
    """Shadow registers of those in `loop`, in the same order."""


def operands_of(state: State) -> FlowOperands:
    """Return the operands of flow rules for one CPU, located in its record."""
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
    """Return whether an instruction stalls for a cycle.

    It stalls if its predecessor wrote, on its destination side, a register that this one uses as source pointer
    (isa.md §13.2). Both arguments are masks in which bit n stands for Wn.
    """
    return (written & pointers) != 0 if pointers else 0


def words_skipped(insn: Insn | None) -> int:
    """Return the number of words, and cycles, that a skip adds; an illegal word counts as one (isa.md §7.3)."""
    return 1 if insn is None else insn.words


def execute_repeat(m: FlowBuilder, p: FlowOperands, count: Number) -> bool:
    """Execute REPEAT. Return whether the next instruction is repeated; with a count of 0 it is not (isa.md §7.5)."""
    m.put(p.rcount, count)
    if not m.is_true(count):
        return False
    m.put(p.sr, m.get(p.sr) | RA)
    m.put(p.repeat, FIRST)
    return True


def end_iteration(m: FlowBuilder, p: FlowOperands, counting: Number) -> bool:
    """End an iteration of a REPEAT target without a flow change. Return whether another iteration follows.

    `counting` is SR.RA, which is 0 in the last iteration (isa.md §7.5).
    """
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


def restore_repeat(m: StraightLineBuilder, p: FlowOperands, count: Number, left: Number) -> None:
    """Restore the REPEAT state as before the iteration with RCOUNT = `left`, for code that counts iterations itself.

    `count` is the count given to REPEAT.
    """
    m.put(p.rcount, left)
    m.put(p.repeat, m.select(left == 0, LAST, m.select(left == count, FIRST, MIDDLE)))
    m.put(p.sr, m.get(p.sr) & (0xFFFF & ~RA) | m.select(left == 0, 0, RA))


def execute_do(m: StraightLineBuilder, p: FlowOperands, count: Number, start: int, end: int) -> None:
    """Execute DO for the loop from `start` to the instruction at `end`.

    The registers of the outer loop are copied to the shadow registers, unless those already hold an outer loop's: at
    deeper levels software saves the registers (isa.md §7.6).
    """
    level = (m.get(p.corcon) & DL_MASK) >> DL_SHIFT
    for register, shadow in zip(p.loop, p.shadow, strict=True):
        m.put(shadow, m.select(level < SHADOWED, m.get(register), m.get(shadow)))
    for register, value in zip(p.loop, (count, start & 0xFFFF, start >> 16, end & 0xFFFF, end >> 16), strict=True):
        m.put(register, value)
    _nest(m, p, m.select(level < 7, level + 1, 7))


def end_loop_iteration(m: FlowBuilder, p: FlowOperands) -> bool:
    """End the instruction at DOEND, which did not change the flow. Return whether the loop continues at DOSTART (isa.md
    §7.6)."""
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
    """Set CORCON.DL to `level`, and SR.DA to whether it is not 0."""
    m.put(p.corcon, m.get(p.corcon) & (0xFFFF & ~DL_MASK) | level << DL_SHIFT)
    m.put(p.sr, m.get(p.sr) & (0xFFFF & ~DA) | m.select(level == 0, 0, DA))


def execute_retfie(m: StraightLineBuilder, p: FlowOperands, srl: Number, ipl3: Number) -> None:
    """Execute RETFIE after SR<7:0> and IPL3 are popped (isa.md §7.4). An interrupted REPEAT continues."""
    m.put(p.sr, m.get(p.sr) & 0xFF00 | srl)
    m.put(p.corcon, m.get(p.corcon) & (0xFFFF & ~IPL3) | m.select(ipl3 != 0, IPL3, 0))
    m.put(p.repeat, m.select((srl & RA) != 0, FIRST, m.get(p.repeat)))


def execute_disi(m: StraightLineBuilder, p: FlowOperands, count: int, after: Number) -> None:
    """Execute DISI. Its last cycle, which precedes `after`, and the next `count` cycles are blocked (isa.md §12)."""
    m.put(p.disi_end, after + count)
    m.put(p.disicnt, count)
