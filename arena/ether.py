"""What all robots' infrared emitters do, as far as other robots may know it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

_KEPT: Final = 256
_OVERRUN: Final = 64
"""Tcy by which a robot may be ahead of the end of a quantum: it ends with a whole instruction."""


class Switch(NamedTuple):
    """A pulse line of a robot was switched in a cycle of the trial."""

    robot: int
    cycle: int
    line: int
    lit: int


@dataclass
class Ether:
    """Per robot the trial's cycles at which its pulse lines changed, and to what."""

    robots: int
    quantum: int
    slowest: int = 1 << 62
    """Cycle of the trial before which nobody asks any more than four quanta, where robots run ahead of each other."""
    _cycles: list[list[int]] = field(init=False)
    _lines: list[list[int]] = field(init=False)
    _news: list[Switch] = field(init=False)

    def __post_init__(self) -> None:
        self._cycles = [[] for _ in range(self.robots)]
        self._lines = [[0] for _ in range(self.robots)]
        self._news = []

    def switch(self, robot: int, cycle: int, line: int, lit: bool) -> None:
        """A pulse line of a robot is switched."""
        self._add(Switch(robot, cycle, line, lit))

    def _add(self, switch: Switch) -> None:
        robot, cycle, line, lit = switch
        cycles, lines = self._cycles[robot], self._lines[robot]
        state = lines[-1] | 1 << line if lit else lines[-1] & ~(1 << line)
        if len(cycles) > _KEPT and cycles[_KEPT // 2] < min(cycle, self.slowest) - 4 * self.quantum:
            del cycles[: _KEPT // 2], lines[: _KEPT // 2]
        cycles.append(cycle)
        lines.append(state)
        self._news.append(switch)

    def seen(self, robot: int, cycle: int) -> int:
        """Bit n: others see pulse line n of a robot lit in a cycle of the trial. That is how it was a quantum ago."""
        return self._lines[robot][bisect_right(self._cycles[robot], cycle - self.quantum - _OVERRUN)]

    def take(self) -> list[Switch]:
        """What was added since the last call: what other processes have to hear."""
        news, self._news = self._news, []
        return news

    def hear(self, switches: Iterable[Switch]) -> None:
        """What robots of other processes did."""
        for switch in switches:
            self._add(switch)
