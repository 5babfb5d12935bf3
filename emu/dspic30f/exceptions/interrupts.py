"""Interrupts and traps: hooks of the registers that decide acceptance, and the rules of exceptions.py interpreted.

A change that an instruction writes (IPL, IEC, IPC, DISICNT) counts at the boundary after it. With `ipl_slip` = 1,
that boundary still uses IPL and IEC from before the write. UNVERIFIED which of the two silicon does (isa.md
§14.3). A flag that software sets in cycle e is first 1 in e + 1, so one more instruction executes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from emu.chips.chip import Chip, Vector
from emu.dspic30f.exceptions.exceptions import (
    NO_REQUEST,
    UNMASKABLE,
    accepted,
    enter,
    ipl,
    operands_of,
    request_cycle,
    requested,
    waking,
)
from emu.dspic30f.exceptions.traps import Traps
from emu.dspic30f.state.data_space import DataSpace
from emu.dspic30f.state.state import STACK_POINTER, State
from emu.system.bus import Bus, WriteHook
from emu.system.device import FLAG_WORDS
from emu.system.events import Events
from emu.system.program import ProgramMemory
from emu.system.rules import Rule, RuleInterpreter


@dataclass(frozen=True, slots=True)
class Accepted:
    """Exception that a boundary accepts: its CPU priority, its vector, and its request cycle (c of isa.md §14.3)."""

    level: int
    vector: Vector
    since: int


class Exceptions(RuleInterpreter):
    """Acceptance and entry of exceptions. The recheck event covers requests that become acceptable merely by time."""

    def __init__(
        self, state: State, events: Events, bus: Bus, data: DataSpace, program: ProgramMemory, traps: Traps, chip: Chip
    ) -> None:
        super().__init__(state.record, events)
        self._state: Final = state
        self._data: Final = data
        self._program: Final = program
        self.traps: Final = traps
        self._u16: Final = state.u16
        self._u64: Final = state.record.u64
        self._ram_start: Final = chip.data["ram"].start
        self._inttreg: Final = state.at["INTTREG"]
        self._names: Final = [vector.name for vector in chip.vectors]
        self._recheck: Final = events.slot("cpu.look", lambda _due: None)
        self.on_trap: Callable[[Vector], None] | None = None
        """Called before a trap is entered, with the machine in the state of the fault."""
        self.ipl_slip = 0
        self._slip_cycle: Final = state.record.reserve("cpu.slip_cycle", "Q").index
        self._slip_words: Final = state.record.reserve("cpu.slip_words", "H", 1 + FLAG_WORDS).index
        self.operands: Final = operands_of(state, chip, self._recheck)
        self._words: Final = [(flags.index, enables.index) for flags, enables in self.operands.words]
        self._vectors: Final = {vector.slot: vector for vector in chip.vectors}
        self._hook(bus)
        recheck = Rule(self.operands.recheck, fires=lambda m, slot: m.put(slot.deadline, 0))
        events.set_rule(self._recheck, recheck, self.fire)

    def _hook(self, bus: Bus) -> None:
        """Hook all registers for which a write can change the result of `acceptable`."""
        indices, priorities = iter(self.operands.since), iter(self.operands.priority)
        for flags, enables in self._words:
            bus.modelled[flags] = bus.modelled[enables] = True
            bus.on_write[flags] = partial(self._flags_written, [next(indices) for _ in range(16)])
            bus.on_write[enables] = partial(self._enables_written, enables)
        for priority in priorities:
            if priority:
                bus.modelled[priority] = True
                bus.on_write[priority] = self._priorities_written
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
        self.traps.intcon1_written(old, new)

    def _read_intcon2(self) -> int:
        """Return INTCON2. Its bit 14 reads 1 while DISICNT is not 0 (isa.md §12)."""
        stored = self._state.intcon2 & ~0x4000
        return stored | 0x4000 if self._state.disi_end > self._events.now else stored

    def _flags_written(self, since: list[int], old: int, new: int, _lanes: int) -> None:
        """Record the request cycle of flags that software sets: they are first visible in the next cycle."""
        set_now = new & ~old
        for bit, index in enumerate(since):
            if set_now >> bit & 1:
                self._u64[self.operands.first_request.index + index] = self._events.now + 1
        self._events.kick()

    def _remember(self, word: int, old: int) -> None:
        """Save SR and the enable registers as they were before this cycle's first write, for `ipl_slip`."""
        if self.ipl_slip:
            now = self._events.now
            if self._u64[self._slip_cycle] != now + 1:
                self._u64[self._slip_cycle] = now + 1
                for number, index in enumerate([self._state.at["SR"], *(enables for _, enables in self._words)]):
                    self._u16[self._slip_words + number] = old if index == word else self._u16[index]
        self._events.kick()

    def forget(self) -> None:
        """Cancel the recheck event after a reset, or because the next boundary checks anyway."""
        self._events.cancel(self._recheck)

    def acceptable(self, last: int) -> Accepted | None:
        """Return the exception that the boundary after cycle `last` accepts, or None.

        If a request will become acceptable in a later cycle without any other event, the recheck event is posted.
        """
        pending = self._state.intcon1 & self.traps.flags
        slip = last + 1 if self.ipl_slip else None
        if pending:
            level = ipl(self, self.operands, slip)
            for trap in self.traps.all:
                if pending & trap.flag and trap.vector.level > level and self._visible(trap.since, last):
                    return Accepted(trap.vector.level, trap.vector, self._u64[trap.since])
        u16 = self._u16
        if slip is None and not any(u16[flags] & u16[enables] for flags, enables in self._words):
            return None  # the most frequent case: no request
        bits = requested(self, self.operands, slip)
        number, level = accepted(self, self.operands, bits, last, slip)
        if number == NO_REQUEST:
            return None
        return Accepted(level, self._vectors[self.operands.slot[number]], request_cycle(self, self.operands, number))

    def _visible(self, since: int, last: int) -> bool:
        if self._u64[since] <= last:
            return True
        if self._u64[since] < self._events.due(self._recheck):
            self._events.set(self._recheck, self._u64[since])
        return False

    def waking(self) -> int | None:
        """Return the cycle of a request that ends Idle or Sleep, None if there is none.

        Such a request is a trap, or an enabled interrupt of priority 1 or more; the CPU priority does not matter
        (isa.md §11).
        """
        for trap in self.traps.all:
            if self._state.intcon1 & trap.flag:
                return self._u64[trap.since]
        number = waking(self, self.operands, requested(self, self.operands))
        return None if number == NO_REQUEST else request_cycle(self, self.operands, number)

    def has_enabled_interrupt(self) -> bool:
        """Whether an interrupt of priority 1 or more is enabled."""
        bits = sum(self.get(enables) << 16 * number for number, (_flags, enables) in enumerate(self.operands.words))
        return bool(waking(self, self.operands, bits & self.operands.implemented) != NO_REQUEST)

    def enter(self, chosen: Accepted, last: int) -> None:
        """Enter the handler of an accepted exception."""
        vector = chosen.vector
        if chosen.level > UNMASKABLE and self.on_trap is not None:
            self.on_trap(vector)
        enter(self, self.operands, chosen.level, chosen.since, last, (vector.ivt, vector.aivt, vector.slot))

    def last_entered(self) -> str:
        """Describe the exception entered last, from INTTREG and the stack, for messages; empty if there was none."""
        slot, top = self._u16[self._inttreg] & 0x3F, self._u16[STACK_POINTER]
        if not slot or slot >= len(self._names) or self._data.faulty(top - 4 & 0xFFFF, 2):
            return ""
        low, high = self._u16[top - 4 >> 1], self._u16[top - 2 >> 1]
        return f"{self._names[slot]} at {(high & 0x7F) << 16 | low:06X}"

    def push(self, low: int, high: int, cycle: int) -> None:
        """Push two words at [W15++], in `cycle` and the next, with the checks of every stack access (isa.md §10)."""
        for later, value in enumerate((low, high)):
            ea = self._u16[STACK_POINTER]
            self._events.arrive(cycle + later)
            if self.beyond_stack(ea):
                self.traps.request(self.traps.stack, cycle + later + 1)
            if self._data.faulty(ea, 2):
                self.traps.request(self.traps.address, cycle + later)
            else:
                self._data.write(ea, value, 2)
            self._state.set_w(STACK_POINTER, ea + 2)

    def handler(self, vector: int) -> int:
        """Return the handler address stored in the vector at `vector`."""
        return self._program.word(vector)

    def beyond_stack(self, ea: int) -> bool:
        """Whether an address in W15 is out of bounds (isa.md §10.1, §10.2)."""
        return ea < self._ram_start or (bool(self._state.limit_armed) and ea > self._state.splim)
