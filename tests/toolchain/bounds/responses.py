"""Measures interrupt response times and stack depth of programs on the emulator."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import emu
from emu.chips import chip_named
from emu.system.device import flag_since
from emu.system.events import NEVER

CHIP = chip_named()


@dataclass
class Handled:
    """Observations of one handler: maximum Tcy from a request to its first instruction.

    Times during which the handler serves an earlier request are excluded.
    """

    late: int = 0
    times: int = 0


@dataclass
class Watched:
    """Observations of one run, or the maxima of several runs.

    Handlers are keyed by their C name without `_`; the stack depth is counted from main's.
    """

    handlers: dict[str, Handled]
    stack: int = 0
    nested: int = 0
    """Maximum number of nested handlers."""

    def add(self, other: Watched) -> None:
        """Take the maximum of both observations in each field."""
        self.stack, self.nested = max(self.stack, other.stack), max(self.nested, other.nested)
        for name, one in other.handlers.items():
            mine = self.handlers.setdefault(name, Handled())
            mine.late, mine.times = max(mine.late, one.late), mine.times + one.times


def watched(image: Path, names: Iterable[str], phases: Iterable[Mapping[str, int]], cycles: int) -> Watched:
    """Run `cycles` Tcy from main once per phase and return the maxima.

    A phase sets the variables that shift the interrupts.
    """
    machine = emu.load(image, engine="plain")
    assert machine.image is not None
    vectors = {vector.name: vector for vector in CHIP.vectors}
    assert machine.run(until="main", seconds=1).reason == "until"
    begin = machine.snapshot()
    found = Watched({})
    entries: dict[int, list[tuple[str, int]]] = {}
    for name in names:
        source = CHIP.interrupts[vectors[name].irq]
        register, bit = source.flag
        symbol = machine.image.symbols.find("__" + name)
        assert symbol is not None, name
        since = flag_since(machine.core.state.record, CHIP.sfrs[register].address, bit)
        entries.setdefault(symbol.address, []).append((name, since))
    for phase in phases:
        machine.restore(begin)
        for variable, value in phase.items():
            machine.poke(variable, value)
        found.add(_run(machine, entries, cycles))
    return found


def _run(machine: emu.Machine, entries: dict[int, list[tuple[str, int]]], cycles: int) -> Watched:
    seen = Watched({name: Handled() for names in entries.values() for name, _ in names})
    u64 = machine.core.state.record.u64
    base, limit = machine.w[15], machine.cycle + cycles
    ended: dict[str, int] = {}
    open_: list[tuple[int, str]] = []
    while machine.cycle < limit:
        stop = machine.service_boundary(NEVER)
        if stop is not None and stop.reason == "halt":
            break  # the machine has stopped
        assert stop is None, stop
        for name, since in entries.get(machine.pc, []):
            if len(entries[machine.pc]) > 1 and machine.peek("INTTREG") & 0x3F != _slot(name):
                continue
            request = u64[since]
            if request > ended.get(name, -1) and all(name != other for _, other in open_):
                one = seen.handlers[name]
                one.late, one.times = max(one.late, machine.cycle - request), one.times + 1
            open_.append((machine.w[15] - 4, name))
            seen.nested = max(seen.nested, len(open_))
        seen.stack = max(seen.stack, machine.w[15] - base)
        stop = machine.step()
        assert stop is None, stop
        seen.stack = max(seen.stack, machine.w[15] - base)
        while open_ and machine.w[15] <= open_[-1][0]:
            ended[open_.pop()[1]] = machine.cycle
    return seen


def _slot(name: str) -> int:
    return next(vector.slot for vector in CHIP.vectors if vector.name == name)
