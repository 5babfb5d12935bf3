"""Rules of exceptions (isa.md §14): which interrupt an instruction boundary accepts, and how a handler is entered.

All engines use these functions (contract: emu/system/rules.py). The timing rule is isa.md §14.3. Let c be the cycle in
which the request was first visible, and e the last cycle of the instruction before the boundary (c <= e). Then the
first instruction of the handler executes in cycle max(c + 4, e + 3). The two cycles before it push the words.
`interrupts.py` handles traps until they are entered.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Protocol

from emu.chips.chip import Chip
from emu.dspic30f.isa.flow import PC_MASK
from emu.dspic30f.state.registers import NSTDIS
from emu.dspic30f.state.state import IPL3, IPL_MASK, NOT_REPEATING, RA, RUN, State
from emu.system.device import flag_since
from emu.system.rules import Cell, EventSlot, Number, RuleBuilder, cell_of, event_slot

ALTIVT: Final = 1 << 15
"""ALTIVT bit, INTCON2<15> (isa.md §14.4)."""
UNMASKABLE: Final = 7
"""Interrupt priority that DISI does not block (isa.md §12)."""
NO_REQUEST: Final = -1
"""Request number that means no request."""
_IPL_SHIFT: Final = 5


class BoundaryBuilder(RuleBuilder, Protocol):
    """Builder operations for rules that run between two instructions."""

    def push(self, low: Number, high: Number, cycle: Number) -> None:
        """Push two words at [W15++], in `cycle` and the next, with the checks of every stack access (isa.md §10)."""

    def handler(self, vector: Number) -> Number:
        """Return the handler address stored in the vector at `vector`."""


@dataclass(frozen=True, slots=True)
class ExceptionOperands:
    """Registers and cells for acceptance and entry. A request's number is 16 x index of its flag register + bit."""

    words: tuple[tuple[Cell, Cell], ...]
    """Pairs of flag register and enable register."""
    implemented: int
    """Bit mask of the numbers of the implemented requests."""
    priority: tuple[int, ...]
    """Table by request number: index of the register that holds the priority.

    The next fields are such tables too. `shift` is the priority's position in that register, `since` the index of the
    cell with the request's cycle, `ivt` and `aivt` the vectors' addresses, and `slot` the vector number.
    """
    shift: tuple[int, ...]
    since: tuple[int, ...]
    ivt: tuple[int, ...]
    aivt: tuple[int, ...]
    slot: tuple[int, ...]
    first_word: Cell
    """Data address 0, the base of the register indices in `priority`."""
    first_request: Cell
    """Base of the cell indices in `since`."""
    recheck: EventSlot
    """Event that makes the engine check again for acceptable requests."""
    slip_cycle: Cell
    slip_words: Cell
    """With `ipl_slip`: SR and enable registers before the last write; `slip_cycle` is the cycle after the write."""
    sr: Cell
    corcon: Cell
    intcon1: Cell
    intcon2: Cell
    inttreg: Cell
    disi_end: Cell
    cycle: Cell
    pc: Cell
    mode: Cell
    repeat: Cell
    stall: Cell


def operands_of(state: State, chip: Chip, recheck: int) -> ExceptionOperands:
    """Return the operands for a chip. The cells of `Exceptions` must be reserved; `recheck` is its event slot."""
    record, sfrs = state.record, chip.sfrs
    names = sorted({(sfrs[s.flag[0]].address, sfrs[s.enable[0]].address) for s in chip.interrupts.values()})
    order = {flags: number for number, (flags, _enables) in enumerate(names)}
    first = flag_since(record, 0, 0)
    vectors = {vector.irq: vector for vector in chip.vectors}
    rows = [(0, 0, 0, 0, 0, 0)] * (16 * len(names))
    implemented = 0
    for irq, source in chip.interrupts.items():
        flags, bit = sfrs[source.flag[0]].address, source.flag[1]
        number, vector = 16 * order[flags] + bit, vectors[irq]
        since = flag_since(record, flags, bit) - first
        group, shift = source.priority
        rows[number] = (sfrs[group].address >> 1, shift, since, vector.ivt, vector.aivt, vector.slot)
        implemented |= 1 << number
    columns = zip(("priority", "shift", "since", "ivt", "aivt", "slot"), zip(*rows, strict=True), strict=True)
    registers = {name.lower(): Cell(sfrs[name].address, 16)
                 for name in ("SR", "CORCON", "INTCON1", "INTCON2", "INTTREG")}  # fmt: skip
    cells = ("slip_cycle", "slip_words", "disi_end", "cycle", "pc", "mode", "repeat", "stall")
    rest: dict[str, Any] = dict(columns) | registers | {name: cell_of(record, f"cpu.{name}") for name in cells}
    return ExceptionOperands(
        words=tuple((Cell(flags, 16), Cell(enables, 16)) for flags, enables in names),
        implemented=implemented,
        first_word=Cell(0, 16),
        first_request=cell_of(record, "irq.since"),
        recheck=event_slot(record, recheck),
        **rest,
    )


def requested(m: RuleBuilder, p: ExceptionOperands, slip: Number | None = None) -> Number:
    """Return a bit mask of the enabled requests. `slip`: with `ipl_slip`, the cycle after the boundary, else None."""
    bits: Number = 0
    for number, (flags, enables) in enumerate(p.words):
        enabled = m.get(enables)
        if slip is not None:
            enabled |= m.select(m.get(p.slip_cycle) == slip, m.get(p.slip_words, 1 + number), 0)
        bits = bits | ((m.get(flags) & enabled) << (16 * number))
    return bits & p.implemented


def ipl(m: RuleBuilder, p: ExceptionOperands, slip: Number | None = None) -> Number:
    """Return the CPU priority that an exception must exceed, 0..15; `slip` as for `requested`."""
    priority = m.get(p.sr) & IPL_MASK
    if slip is not None:
        before = m.get(p.slip_words) & IPL_MASK
        priority = m.select((m.get(p.slip_cycle) == slip) & (before < priority), before, priority)
    return (m.get(p.corcon) & IPL3) | priority >> _IPL_SHIFT


def level_of(m: RuleBuilder, p: ExceptionOperands, number: Number) -> Number:
    """Return the priority of a request, 0..7."""
    return m.get(p.first_word, m.table(p.priority, number)) >> m.table(p.shift, number) & 7


def accepted(
    m: RuleBuilder, p: ExceptionOperands, bits: Number, last: Number, slip: Number | None = None
) -> tuple[Number, Number]:
    """Return number and level of the request in `bits` that is accepted after cycle `last`; NO_REQUEST if none is.

    A request that becomes acceptable later merely by time makes this rule post the recheck event."""
    disi_end = m.get(p.disi_end)

    def better(number: Number, level: Number, winner: Number, check: Number) -> tuple[Number, ...]:
        own, since = level_of(m, p, number), request_cycle(m, p, number)
        held = (own < UNMASKABLE) & (last < disi_end)
        until, higher = m.select(held, disi_end, since), own > level
        waits = higher & (held | (last < since))
        wins = higher & (last >= since) & (held == 0)
        return m.select(wins, own, level), m.select(wins, number, winner), m.select(
            waits & m.below(until, check), until, check)  # fmt: skip

    level, winner, check = m.scan(bits, better, ipl(m, p, slip), NO_REQUEST, m.get(p.recheck.due))
    m.post(p.recheck, check)
    return winner, level


def waking(m: RuleBuilder, p: ExceptionOperands, bits: Number) -> Number:
    """Return the first request in `bits` that ends Idle or Sleep, or NO_REQUEST.

    Its priority is 1 or more; the CPU priority does not matter (isa.md §11).
    """

    def first(number: Number, found: Number) -> tuple[Number, ...]:
        return (m.select((found == NO_REQUEST) & (level_of(m, p, number) != 0), number, found),)

    return m.scan(bits, first, NO_REQUEST)[0]


def request_cycle(m: RuleBuilder, p: ExceptionOperands, number: Number) -> Number:
    """Return the cycle in which a request was first visible: c of isa.md §14.3."""
    return m.get(p.first_request, m.table(p.since, number))


def enter(
    m: BoundaryBuilder, p: ExceptionOperands, level: Number, since: Number, last: Number, vectors: tuple[Number, ...]
) -> None:
    """Push PC, SRL and IPL3, and continue at the handler (isa.md §14.2). `vectors` holds the addresses of its vector in
    the vector table and in the alternate one, and its number."""
    ivt, aivt, slot = vectors
    soonest, earliest = since + 4, last + 3
    start = m.select(soonest < earliest, earliest, soonest)
    pc, status = m.get(p.pc), (m.get(p.sr) & 0xFF) << 8 | (m.get(p.corcon) & IPL3) << 4
    m.push(pc & 0xFFFF, status | pc >> 16, start - 2)
    nests = (m.get(p.intcon1) & NSTDIS) == 0
    raised = m.select(nests | (level > UNMASKABLE), level, UNMASKABLE)
    m.put(p.sr, (m.get(p.sr) & (0xFFFF & ~(IPL_MASK | RA))) | (raised & 7) << _IPL_SHIFT)
    m.put(p.corcon, (m.get(p.corcon) & (0xFFFF & ~IPL3)) | (raised & IPL3))
    m.put(p.pc, m.handler(m.select((m.get(p.intcon2) & ALTIVT) == 0, ivt, aivt)) & PC_MASK)
    for cell, value in ((p.mode, RUN), (p.repeat, NOT_REPEATING), (p.stall, 0), (p.cycle, start)):
        m.put(cell, value)
    m.put(p.inttreg, level << 8 | slot)
    m.put(p.recheck.deadline, 0)
