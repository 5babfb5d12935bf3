"""Where every cycle goes: functions, interrupt levels, Idle. Exact, because the machine is stepped.

What enters: a machine with its image. What leaves: a `Profile`, whose numbers add up to the cycles run. Entering an
exception (the forced NOPs and pushes, isa.md §14.2) counts for the function that is entered, at its level.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from fnmatch import fnmatch
from typing import TYPE_CHECKING, Final

from emu.image import Image

if TYPE_CHECKING:
    from emu.machine import Machine, Stop

ENTRY_AFTER_SLEEP: Final = 3
"""Tcy from the first running cycle after Idle to the first instruction of the interrupt that ended it."""


Place = tuple[str, str]
"""Function and source file."""


@dataclass(slots=True)
class Profile:
    """Cycles by what they were spent on."""

    idle: int = 0
    """In Idle or Sleep."""
    places: Counter[Place] = field(default_factory=Counter)
    """By function and source file: code that was inlined keeps its file."""
    levels: Counter[int] = field(default_factory=Counter)
    """By CPU priority: 0 to 7, traps 8 and above."""
    stop: Stop | None = None
    """What ended the run before its time."""

    @property
    def functions(self) -> Counter[str]:
        """By function, without what it calls."""
        return self._summed(0)

    @property
    def files(self) -> Counter[str]:
        """By source file; "" is code without lines."""
        return self._summed(1)

    def _summed(self, part: int) -> Counter[str]:
        sums: Counter[str] = Counter()
        for place, cycles in self.places.items():
            sums[place[part]] += cycles
        return sums

    @property
    def busy(self) -> int:
        """Cycles in which the CPU worked."""
        return sum(self.places.values())

    @property
    def cycles(self) -> int:
        """All cycles."""
        return self.busy + self.idle

    def group(self, patterns: list[str]) -> int:
        """Cycles of code whose function or source file matches one of the patterns (`*`, `?`, `[...]`)."""
        return sum(cycles for place, cycles in self.places.items() if _matches(place, patterns))

    def matched(self, pattern: str) -> bool:
        """Whether a pattern fits anything that ran."""
        return any(_matches(place, [pattern]) for place in self.places)


def _matches(place: Place, patterns: list[str]) -> bool:
    return any(fnmatch(name, pattern) for name in place for pattern in patterns)


class Profiler:
    """Steps a machine and writes down where its cycles go."""

    def __init__(self, machine: Machine, image: Image) -> None:
        self._machine: Final = machine
        self._image: Final = image
        self._places: Final[dict[int, Place]] = {}

    def run(self, until: int) -> Profile:
        """Run to cycle `until`; ends earlier with whatever stops the machine."""
        machine, profile = self._machine, Profile()
        while machine.cycle < until and profile.stop is None:
            cycle, pc, asleep = machine.cycle, machine.pc, machine.is_asleep
            profile.stop = machine.approach(until)
            spent = machine.cycle - cycle
            entry = spent if not asleep else min(spent, ENTRY_AFTER_SLEEP) if machine.pc != pc else 0
            profile.idle += spent - entry
            if profile.stop is not None or machine.cycle >= until:
                self._count(profile, entry)
                break
            cycle, place, level = machine.cycle - entry, self._place(), machine.state.ipl
            profile.stop = machine.step()
            profile.places[place] += machine.cycle - cycle
            profile.levels[level] += machine.cycle - cycle
        return profile

    def _count(self, profile: Profile, cycles: int) -> None:
        if cycles:
            profile.places[self._place()] += cycles
            profile.levels[self._machine.state.ipl] += cycles

    def _place(self) -> Place:
        """Of the instruction that comes next."""
        pc = self._machine.pc
        place = self._places.get(pc)
        if place is None:
            line = self._image.lines.find(pc)
            place = self._places[pc] = self._image.symbols.text(pc).split("+")[0], line.file if line is not None else ""
        return place
