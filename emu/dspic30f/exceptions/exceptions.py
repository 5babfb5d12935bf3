"""Which interrupt is accepted at an instruction boundary, and entering an exception (isa.md §14): one text for every
engine (contract: emu/system/rules.py).

The rule of time is isa.md §14.3: with c the cycle in which the request was first visible and e the last cycle of the
instruction before the boundary (c <= e), the handler's first instruction executes in cycle max(c + 4, e + 3). The words
are pushed in the two cycles before it. Traps are `interrupts.py`'s until they are entered.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Protocol

from emu.chips.chip import Chip
from emu.dspic30f.state.registers import NSTDIS
from emu.dspic30f.state.state import IPL3, IPL_MASK, NOT_REPEATING, PC_MASK, RA, RUN, State
from emu.system.device import flag_since
from emu.system.rules import Cell, EventSlot, Number, RuleBuilder, cell_of, event_slot

ALTIVT: Final = 1 << 15
"""INTCON2<15> (isa.md §14.4)."""
UNMASKABLE: Final = 7
"""User interrupt priority that DISI does not block (isa.md §12)."""
NO_REQUEST: Final = -1
"""Instead of a request's number."""
_IPL_SHIFT: Final = 5


class BoundaryBuilder(RuleBuilder, Protocol):
    """What a reader can do between two instructions."""

    def push(self, low: Number, high: Number, cycle: Number) -> None:
        """Two words at [W15++], in `cycle` and the next, with the checks of every stack access (isa.md §10)."""

    def handler(self, vector: Number) -> Number:
        """The program word of a vector."""


@dataclass(frozen=True, slots=True)
class ExceptionOperands:
    """Registers and cells of acceptance and entry. A request's number: 16 x place of its flag register + its bit."""

    words: tuple[tuple[Cell, Cell], ...]
    """Flags and enables."""
    implemented: int
    """Numbers there are, as bits."""
    priority: tuple[int, ...]
    """By number: index of the register with its priority, the shift there, index of the cycle it rose in, and vectors:
    addresses in both tables, number."""
    shift: tuple[int, ...]
    since: tuple[int, ...]
    ivt: tuple[int, ...]
    aivt: tuple[int, ...]
    slot: tuple[int, ...]
    first_word: Cell
    """Data address 0, to which `priority` counts."""
    first_rise: Cell
    look: EventSlot
    """Makes the engine look again."""
    slip_cycle: Cell
    slip_words: Cell
    """With `ipl_slip`: the cycle behind the last write, and SR and enables from before it."""
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


def operands_of(state: State, chip: Chip, look: int) -> ExceptionOperands:
    """From a chip's data, once the cells of `Exceptions` are reserved; `look` is its event slot."""
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
        first_rise=cell_of(record, "irq.since"),
        look=event_slot(record, look),
        **rest,
    )


def requested(m: RuleBuilder, p: ExceptionOperands, slip: Number | None = None) -> Number:
    """Numbers of the enabled requests as bits. `slip`, if interrupts may slip through: the cycle that comes next."""
    bits: Number = 0
    for number, (flags, enables) in enumerate(p.words):
        enabled = m.get(enables)
        if slip is not None:
            enabled |= m.select(m.get(p.slip_cycle) == slip, m.get(p.slip_words, 1 + number), 0)
        bits = bits | ((m.get(flags) & enabled) << (16 * number))
    return bits & p.implemented


def ipl(m: RuleBuilder, p: ExceptionOperands, slip: Number | None = None) -> Number:
    """CPU priority that an exception must beat, 0..15. `slip` as for `requested`."""
    priority = m.get(p.sr) & IPL_MASK
    if slip is not None:
        before = m.get(p.slip_words) & IPL_MASK
        priority = m.select((m.get(p.slip_cycle) == slip) & (before < priority), before, priority)
    return (m.get(p.corcon) & IPL3) | priority >> _IPL_SHIFT


def level_of(m: RuleBuilder, p: ExceptionOperands, number: Number) -> Number:
    """Priority of a request, 0..7."""
    return m.get(p.first_word, m.table(p.priority, number)) >> m.table(p.shift, number) & 7


def accepted(
    m: RuleBuilder, p: ExceptionOperands, bits: Number, last: Number, slip: Number | None = None
) -> tuple[Number, Number]:
    """Number and level of the request among `bits` that wins behind cycle `last`, or NOBODY. What time alone makes
    acceptable later is noted: the engine will look again then."""
    disi_end = m.get(p.disi_end)

    def better(number: Number, level: Number, winner: Number, look: Number) -> tuple[Number, ...]:
        mine, since = level_of(m, p, number), request_cycle(m, p, number)
        held = (mine < UNMASKABLE) & (last < disi_end)
        until, higher = m.select(held, disi_end, since), mine > level
        waits = higher & (held | (last < since))
        wins = higher & (last >= since) & (held == 0)
        return m.select(wins, mine, level), m.select(wins, number, winner), m.select(
            waits & m.below(until, look), until, look)  # fmt: skip

    level, winner, look = m.scan(bits, better, ipl(m, p, slip), NO_REQUEST, m.get(p.look.due))
    m.post(p.look, look)
    return winner, level


def waking(m: RuleBuilder, p: ExceptionOperands, bits: Number) -> Number:
    """The first request among `bits` that ends Idle or Sleep: of priority 1 or more, whatever the CPU priority (isa.md
    §11); or NOBODY."""

    def first(number: Number, found: Number) -> tuple[Number, ...]:
        return (m.select((found == NO_REQUEST) & (level_of(m, p, number) != 0), number, found),)

    return m.scan(bits, first, NO_REQUEST)[0]


def request_cycle(m: RuleBuilder, p: ExceptionOperands, number: Number) -> Number:
    """The cycle in which a request was first visible: c of isa.md §14.3."""
    return m.get(p.first_rise, m.table(p.since, number))


def enter(
    m: BoundaryBuilder, p: ExceptionOperands, level: Number, since: Number, last: Number, vectors: tuple[Number, ...]
) -> None:
    """Push PC, SRL and IPL3, and continue at the handler (isa.md §14.2). `vectors`: its address in the vector table and
    in the alternate one, and its number."""
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
    for place, value in ((p.mode, RUN), (p.repeat, NOT_REPEATING), (p.stall, 0), (p.cycle, start)):
        m.put(place, value)
    m.put(p.inttreg, level << 8 | slot)
    m.put(p.look.deadline, 0)
