"""What all robots' infrared emitters and LEDs do, as far as other robots may know it, and how far receivers have
followed the emitters."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from arena.scene import FCY, Scene
from emu.boards.epuck.analog import PULSE_PINS, TAU_SECONDS

LINES: Final = len(PULSE_PINS)
SETTLED: Final = 16.0
"""Time constants after which what an emitter did before is forgotten: e^-16 of full light is 4e-4 counts."""
PAUSE_S: Final = 0.0029
"""Darkness after which light is another transmission: 12 scans of the firmware's link, which begins nothing earlier
(firmware/openswarm/io/infrared/link.c)."""
_KEPT: Final = 256
_OVERRUN: Final = 64
"""Tcy by which a robot may be ahead of the end of a quantum: it ends with a whole instruction."""
_STEADY: Final = tuple(tuple(float(lit >> line & 1) for line in range(LINES)) for lit in range(1 << LINES))

Shares = tuple[float, ...]
"""Of each pulse line: how far receivers have settled to its full light, 0 to 1."""


class Switch(NamedTuple):
    """A pulse line of a robot, or from `LINES` on one of its LEDs, was switched in a cycle of the trial."""

    robot: int
    cycle: int
    line: int
    lit: int


@dataclass
class Ether:
    """Per robot the trial's cycles at which its pulse lines and its LEDs changed, and to what."""

    robots: int
    quantum: int
    slowest: int = 1 << 62
    """Cycle of the trial before which nobody asks any more than four quanta, where robots run ahead of each other."""
    tau: float = TAU_SECONDS * FCY
    """Time constant of the receivers in Tcy."""
    _cycles: list[list[int]] = field(init=False)
    _lines: list[list[int]] = field(init=False)
    _begun: list[list[int]] = field(init=False)
    """For each switch of the pulse lines, the cycle in which its transmission began."""
    _led_cycles: list[list[int]] = field(init=False)
    _leds: list[list[int]] = field(init=False)
    _news: list[Switch] = field(init=False)
    _at_switch: list[tuple[int, Shares]] = field(init=False)
    """Per robot the last answer about a switch: its cycle, and the shares in it."""
    _settled: int = field(init=False)
    """Tcy after which a switch is forgotten."""

    def __post_init__(self) -> None:
        self._cycles = [[] for _ in range(self.robots)]
        self._lines = [[0] for _ in range(self.robots)]
        self._begun = [[] for _ in range(self.robots)]
        self._led_cycles = [[] for _ in range(self.robots)]
        self._leds = [[0] for _ in range(self.robots)]
        self._news = []
        self._at_switch = [(-1, _STEADY[0])] * self.robots
        self._settled = round(SETTLED * self.tau)

    @classmethod
    def of(cls, scene: Scene) -> Ether:
        """That of a trial in a scene."""
        return cls(scene.robots.count, scene.clock.quantum_tcy, tau=scene.infrared.tau_us * 1e-6 * FCY)

    def switch(self, robot: int, cycle: int, line: int, lit: bool) -> None:
        """A pulse line or LED of a robot is switched."""
        self._add(Switch(robot, cycle, line, lit))

    def _add(self, switch: Switch) -> None:
        robot, cycle, line, lit = switch
        cycles, lines = self._cycles[robot], self._lines[robot]
        if line >= LINES:
            cycles, lines, line = self._led_cycles[robot], self._leds[robot], line - LINES
        begun = self._begun[robot] if cycles is self._cycles[robot] else None
        state = lines[-1] | 1 << line if lit else lines[-1] & ~(1 << line)
        if len(cycles) > _KEPT and cycles[_KEPT // 2] < self._looked_back(min(cycle, self.slowest)):
            del cycles[: _KEPT // 2], lines[: _KEPT // 2]
            if begun is not None:
                del begun[: _KEPT // 2]
        if begun is not None:
            is_new = not cycles or (not lines[-1] and cycle - cycles[-1] > PAUSE_S * FCY)
            begun.append(cycle if is_new else begun[-1])
        cycles.append(cycle)
        lines.append(state)
        self._news.append(switch)

    def _looked_back(self, cycle: int) -> int:
        """Cycle before which nothing matters any more to who asks about `cycle`."""
        return cycle - 4 * self.quantum - 2 * self._settled

    def shares(self, robot: int, cycle: int) -> Shares:
        """What others see of the light of a robot's pulse lines in a cycle of the trial: how it was a quantum ago,
        behind receivers of first order. The same for everybody, whenever it is asked."""
        cycles, since = self._cycles[robot], cycle - self.quantum - _OVERRUN
        index = bisect_right(cycles, since)
        lit = self._lines[robot][index]
        age = since - cycles[index - 1] if index else self._settled
        if age >= self._settled:
            return _STEADY[lit]
        return self._followed(self._shares_at(robot, index - 1), lit, age)

    def begun(self, robot: int, cycle: int) -> int:
        """When the transmission began whose light others see in a cycle of the trial; -1: none yet."""
        index = bisect_right(self._cycles[robot], cycle - self.quantum - _OVERRUN)
        return self._begun[robot][index - 1] if index else -1

    def leds(self, robot: int, cycle: int) -> int:
        """What others see of a robot's LEDs in a cycle of the trial: bit n of those that were lit a quantum ago."""
        return self._leds[robot][bisect_right(self._led_cycles[robot], cycle - self.quantum - _OVERRUN)]

    def is_dark(self, robot: int, first: int, last: int) -> bool:
        """Whether others see no light of a robot from one cycle to another: its emitters are off and forgotten."""
        cycles, lines = self._cycles[robot], self._lines[robot]
        forgotten = first - self.quantum - _OVERRUN - self._settled
        if not lines[-1] and (not cycles or cycles[-1] <= forgotten):
            return True  # at once, as it is most often
        index = bisect_right(cycles, last - self.quantum - _OVERRUN)
        return not lines[index] and (not index or cycles[index - 1] <= forgotten)

    def _shares_at(self, robot: int, index: int) -> Shares:
        """In the cycle of a switch, from what was switched shortly before."""
        cycles, lines = self._cycles[robot], self._lines[robot]
        at, shares = self._at_switch[robot]
        if at != cycles[index]:
            first = bisect_right(cycles, cycles[index] - self._settled)
            shares = _STEADY[lines[first]]
            for place in range(first, index):
                shares = self._followed(shares, lines[place + 1], cycles[place + 1] - cycles[place])
            self._at_switch[robot] = cycles[index], shares
        return shares

    def _followed(self, shares: Shares, lit: int, age: int) -> Shares:
        """`shares` after the lines have been lit as in `lit` for so long."""
        left = math.exp(-age / self.tau)
        return tuple([end + (share - end) * left for share, end in zip(shares, _STEADY[lit], strict=True)])

    def take(self) -> list[Switch]:
        """What was added since the last call: what other processes have to hear."""
        news, self._news = self._news, []
        return news

    def hear(self, switches: Iterable[Switch]) -> None:
        """What robots of other processes did."""
        for switch in switches:
            self._add(switch)
