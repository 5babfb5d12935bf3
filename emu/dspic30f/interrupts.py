"""Exceptions: which one is accepted at an instruction boundary, and entering its handler (isa.md §14).

The rule of time is isa.md §14.3: with c the cycle in which the request was first visible and e the last cycle of the
instruction before the boundary (c <= e), the handler's first instruction executes in cycle max(c + 4, e + 3). The words
are pushed in the two cycles before it.

What the writing instruction itself changes (IPL, IEC, IPC, DISICNT) counts at the boundary right after it; with
`ipl_slip` = 1 that boundary still accepts by the IPL and IEC from before the write. UNVERIFIED which silicon does
(isa.md §14.3). A flag set by software in cycle e is first 1 in e + 1, so one more instruction executes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from emu.bus import Bus, WriteHook
from emu.chips.chip import Chip, Vector
from emu.device import FLAG_WORDS, flag_since
from emu.dspic30f.data import DataSpace
from emu.dspic30f.registers import NSTDIS
from emu.dspic30f.state import IPL3, NOT_REPEATING, PC_MASK, RA, RUN, STACK_POINTER, State
from emu.dspic30f.traps import Traps
from emu.events import Events
from emu.program import ProgramMemory

ALTIVT: Final = 1 << 15
"""INTCON2<15> (isa.md §14.4)."""
UNMASKABLE: Final = 7
"""User interrupt priority that DISI does not block (isa.md §12)."""


@dataclass(frozen=True, slots=True)
class Source:
    """Where one interrupt's priority and the cycle of its request are, as indices into the record's views."""

    vector: Vector
    priority: int
    shift: int
    since: int


@dataclass(frozen=True, slots=True)
class Accepted:
    """An exception that wins at a boundary: the CPU priority it brings, its vector and c of isa.md §14.3."""

    level: int
    vector: Vector
    since: int


class Exceptions:
    """Acceptance and entry. One event slot makes the engine look again when time alone can change the answer."""

    def __init__(
        self, state: State, events: Events, bus: Bus, data: DataSpace, program: ProgramMemory, traps: Traps, chip: Chip
    ) -> None:
        self._state: Final = state
        self._events: Final = events
        self._data: Final = data
        self._program: Final = program
        self.traps: Final = traps
        self._u16: Final = state.u16
        self._u64: Final = state.record.u64
        self._ram_start: Final = chip.data["ram"].start
        self._inttreg: Final = state.at["INTTREG"]
        self._names: Final = [vector.name for vector in chip.vectors]
        self._look: Final = events.slot("cpu.look", lambda _due: events.kick())
        self.on_trap: Callable[[Vector], None] | None = None
        """Called before a trap is entered: the machine stands where it happened."""
        self.ipl_slip = 0
        self._slip_cycle: Final = state.record.reserve("cpu.slip_cycle", "Q").index
        self._slip_words: Final = state.record.reserve("cpu.slip_words", "H", 1 + FLAG_WORDS).index
        self._words: Final = self._tables(chip)
        self._enables: Final = [enables for _flags, enables, _sources in self._words]
        self._hook(bus)

    def _tables(self, chip: Chip) -> list[tuple[int, int, dict[int, Source]]]:
        """Per flag register: its index, the index of its enables, and the sources by bit."""
        vectors = {vector.irq: vector for vector in chip.vectors}
        words: dict[str, tuple[int, int, dict[int, Source]]] = {}
        for irq, source in chip.interrupts.items():
            flag, bit = source.flag
            group, shift = source.priority
            table = words.setdefault(flag, (self._state.at[flag], self._state.at[source.enable[0]], {}))
            since = flag_since(self._state.record, chip.sfrs[flag].address, bit)
            table[2][bit] = Source(vectors[irq], self._state.at[group], shift, since)
        return list(words.values())

    def _hook(self, bus: Bus) -> None:
        """Hear of every write that can change the answer of `acceptable`."""
        for flags, enables, sources in self._words:
            bus.modelled[flags] = bus.modelled[enables] = True
            bus.on_write[flags] = partial(self._flags_written, sources)
            bus.on_write[enables] = partial(self._enables_written, enables)
            for source in sources.values():
                bus.modelled[source.priority] = True
                bus.on_write[source.priority] = self._priorities_written
        at = self._state.at
        for name in ("INTCON1", "INTCON2", "INTTREG"):
            bus.modelled[at[name]] = True
        bus.on_write[at["INTCON1"]] = self._intcon1_written
        bus.compute[at["INTCON2"]] = self._read_intcon2
        bus.on_write[at["SR"]] = partial(self._status_written, bus.on_write[at["SR"]])

    def _status_written(self, rest: WriteHook | None, old: int, new: int, lanes: int) -> None:
        self._remember(self._state.at["SR"], old)
        if rest is not None:
            rest(old, new, lanes)

    def _enables_written(self, word: int, old: int, _new: int, _lanes: int) -> None:
        self._remember(word, old)

    def _priorities_written(self, _old: int, _new: int, _lanes: int) -> None:
        self._events.kick()

    def _intcon1_written(self, old: int, new: int, _lanes: int) -> None:
        self.traps.written(old, new)

    def _read_intcon2(self) -> int:
        """INTCON2<14> reads 1 while DISICNT is not 0 (isa.md §12)."""
        stored = self._state.intcon2 & ~0x4000
        return stored | 0x4000 if self._state.disi_end > self._events.now else stored

    def _flags_written(self, sources: dict[int, Source], old: int, new: int, _lanes: int) -> None:
        """Flags set by software are first 1 in the next cycle."""
        for bit, source in sources.items():
            if (new & ~old) >> bit & 1:
                self._u64[source.since] = self._events.now + 1
        self._events.kick()

    def _remember(self, word: int, old: int) -> None:
        """For `ipl_slip`: SR and the enables as they were before the first write of this cycle."""
        if self.ipl_slip:
            now = self._events.now
            if self._u64[self._slip_cycle] != now + 1:
                self._u64[self._slip_cycle] = now + 1
                for number, index in enumerate([self._state.at["SR"], *self._enables]):
                    self._u16[self._slip_words + number] = old if index == word else self._u16[index]
        self._events.kick()

    def reset(self) -> None:
        """Nothing is awaited any more."""
        self._events.cancel(self._look)

    def acceptable(self, last: int) -> Accepted | None:
        """The exception to enter at the boundary after cycle `last`, None if there is none.

        Requests that time alone makes acceptable later are noted: the engine will look again then.
        """
        state = self._state
        if not self._requested():
            return None
        slipping = bool(self.ipl_slip) and self._u64[self._slip_cycle] == last + 1
        ipl = state.ipl
        if slipping:
            ipl = min(ipl, state.corcon & IPL3 | self._u16[self._slip_words] >> 5 & 7)
        pending = state.intcon1 & self.traps.flags
        if pending:
            for trap in self.traps.all:
                if pending & trap.flag and trap.vector.level > ipl and self._visible(trap.since, last):
                    return Accepted(trap.vector.level, trap.vector, self._u64[trap.since])
        best = None
        for number, (flags, enables, sources) in enumerate(self._words):
            enabled = self._u16[enables]
            if slipping:
                enabled |= self._u16[self._slip_words + 1 + number]
            requests = self._u16[flags] & enabled
            while requests:
                bit = (requests & -requests).bit_length() - 1
                requests &= requests - 1
                source = sources.get(bit)
                if source is not None:
                    level = self._u16[source.priority] >> source.shift & 7
                    if level > (ipl if best is None else best.level) and self._open(source, level, last):
                        best = Accepted(level, source.vector, self._u64[source.since])
        return best

    def _requested(self) -> bool:
        """Whether anything is requested at all; with `ipl_slip`, enables just cleared must be looked at."""
        u16 = self._u16
        if self.ipl_slip or self._state.intcon1 & self.traps.flags:
            return True
        return any(u16[flags] & u16[enables] for flags, enables, _sources in self._words)

    def _open(self, source: Source, level: int, last: int) -> bool:
        """Whether neither time nor DISI holds a request back at the boundary after `last`."""
        if level < UNMASKABLE and last < self._state.disi_end:
            self._wait(self._state.disi_end)
            return False
        return self._visible(source.since, last)

    def _visible(self, since: int, last: int) -> bool:
        if self._u64[since] <= last:
            return True
        self._wait(self._u64[since])
        return False

    def _wait(self, cycle: int) -> None:
        """Look again at the first boundary after `cycle`."""
        if cycle < self._events.due(self._look):
            self._events.set(self._look, cycle)

    def waking(self) -> int | None:
        """Cycle of a request that ends Idle or Sleep, None if there is none: a trap, or an enabled interrupt of
        priority 1 or more, whatever the CPU priority (isa.md §11)."""
        for trap in self.traps.all:
            if self._state.intcon1 & trap.flag:
                return self._u64[trap.since]
        for flags, enables, sources in self._words:
            requests = self._u16[flags] & self._u16[enables]
            for bit, source in sources.items():
                if requests >> bit & 1 and self._u16[source.priority] >> source.shift & 7:
                    return self._u64[source.since]
        return None

    def armed(self) -> bool:
        """Whether any interrupt of priority 1 or more is enabled."""
        for _flags, enables, sources in self._words:
            enabled = self._u16[enables]
            for bit, source in sources.items():
                if enabled >> bit & 1 and self._u16[source.priority] >> source.shift & 7:
                    return True
        return False

    def enter(self, accepted: Accepted, last: int) -> None:
        """Push PC, SRL and IPL3, and continue at the handler (isa.md §14.2)."""
        state = self._state
        if accepted.level > UNMASKABLE and self.on_trap is not None:
            self.on_trap(accepted.vector)
        first = max(accepted.since + 4, last + 3)
        pc, status = state.pc, state.sr & 0xFF
        self._push(pc & 0xFFFF, first - 2)
        self._push(status << 8 | (state.corcon & IPL3) << 4 | pc >> 16, first - 1)
        state.sr &= ~RA
        user = accepted.level <= UNMASKABLE
        state.ipl = UNMASKABLE if user and state.intcon1 & NSTDIS else accepted.level
        alternate = state.intcon2 & ALTIVT
        vector = accepted.vector.aivt if alternate else accepted.vector.ivt
        state.pc = self._program.word(vector) & PC_MASK
        state.mode = RUN
        state.repeat = NOT_REPEATING
        state.stall = 0
        state.cycle = first
        self._u16[self._inttreg] = accepted.level << 8 | accepted.vector.slot

    def latest(self) -> str:
        """The exception entered last, as INTTREG and the stack tell it, for messages; empty if there was none."""
        slot, top = self._u16[self._inttreg] & 0x3F, self._u16[STACK_POINTER]
        if not slot or slot >= len(self._names) or self._data.faulty(top - 4 & 0xFFFF, 2):
            return ""
        low, high = self._u16[top - 4 >> 1], self._u16[top - 2 >> 1]
        return f"{self._names[slot]} at {(high & 0x7F) << 16 | low:06X}"

    def _push(self, value: int, cycle: int) -> None:
        """One word at [W15++] with the checks of every stack access (isa.md §10)."""
        state = self._state
        ea = self._u16[STACK_POINTER]
        self._events.arrive(cycle)
        if self.beyond_stack(ea):
            self.traps.request(self.traps.stack, cycle + 1)
        if self._data.faulty(ea, 2):
            self.traps.request(self.traps.address, cycle)
        else:
            self._data.write(ea, value, 2)
        state.set_w(STACK_POINTER, ea + 2)

    def beyond_stack(self, ea: int) -> bool:
        """Whether a W15 address is out of bounds (isa.md §10.1, §10.2)."""
        return ea < self._ram_start or (bool(self._state.limit_armed) and ea > self._state.splim)
