"""Counts of register accesses by kind, on a machine with the plain engine."""

from __future__ import annotations

from collections import Counter
from typing import Final

from emu.dspic30f.state.state import DA, NOT_REPEATING, RA
from emu.machine.machine import Machine

ACCESS_MODES: Final = ("address", "pointer", "REPEAT", "DO", "handler", "event")
"""Names of access modes. Bit n of a key's last part is mode n: by address, by pointer, under REPEAT, in DO,
in an interrupt handler, in the cycle in which an event is due."""


class Census:
    """Counter of a plain machine's accesses to SFRs while `open` is true, by (address, is write, size, modes)."""

    def __init__(self, machine: Machine) -> None:
        self.counts: Final[Counter[tuple[int, bool, int, int]]] = Counter()
        self.open = False
        self.handlers = range(0)
        """Program addresses of interrupt handlers."""
        core = machine.core
        self._state: Final = core.state
        self._sequencer: Final = core.sequencer
        self._end: Final = core.bus.end
        self._events: Final = core.events
        self._due = -1
        data, events = core.data, core.events
        read, write, fire = data.read, data.write, events._fire_until
        due, slots = events._due, events._fire

        def counted_read(ea: int, size: int) -> int:
            if self.open and ea < self._end:
                self._count(ea, False, size)
            return read(ea, size)

        def counted_write(ea: int, value: int, size: int) -> None:
            if self.open and ea < self._end:
                self._count(ea, True, size)
            write(ea, value, size)

        def noted(cycle: int) -> int:
            if self.open and cycle in due[: len(slots)].tolist():
                self._due = cycle
            return fire(cycle)

        data.read, data.write = counted_read, counted_write  # type: ignore[method-assign]
        events._fire_until = noted  # type: ignore[method-assign]

    def _count(self, ea: int, is_write: bool, size: int) -> None:
        state, builder = self._state, self._sequencer.builder
        step = self._sequencer._steps.get(builder.pc)
        modes = 1 if step is not None and "f" in step.insn.row.fields else 2
        modes |= 4 * bool(state.sr & RA or state.repeat != NOT_REPEATING)
        modes |= 8 * bool(state.sr & DA)
        modes |= 16 * (builder.pc in self.handlers)
        modes |= 32 * (self._due == self._events.now)
        self.counts[ea & ~1, is_write, size, modes] += 1


def modes_of(accesses: Counter[tuple[str, int, bool, int, int]]) -> Counter[tuple[str, int, bool, int, str]]:
    """Return counts by chip, word address, is write, size and mode name. An access counts once for each of its
    modes."""
    found: Counter[tuple[str, int, bool, int, str]] = Counter()
    for (chip, ea, is_write, size, modes), count in accesses.items():
        for bit, name in enumerate(ACCESS_MODES):
            if modes >> bit & 1:
                found[chip, ea, is_write, size, name] += count
    return found
