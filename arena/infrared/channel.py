"""What all robots' infrared emitters and LEDs do, as far as other robots may know it, and how far receivers have
followed the emitters."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from ctypes import Array, Structure, addressof, c_double, c_int64, c_uint8, c_void_p
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from arena.scene.loader import FCY, Scene
from emu.boards.epuck.analog import PULSE_PINS, TAU_SECONDS
from emu.native_library import ADDRESS, DOUBLE, INT, functions

LINES: Final = len(PULSE_PINS)
SETTLED: Final = 16.0
"""Time constants after which what an emitter did before is forgotten: e^-16 of full light is 4e-4 counts."""
PAUSE_S: Final = 0.0155
"""Darkness after which light is another transmission. No frame of the firmware's link is dark for so long: no word
begins with more than 11 zeros or ends with more than 10, and 21 bits last 15.4 ms (firmware/openswarm/io/infrared)."""
_KEPT: Final = 256
_OVERRUN: Final = 64
"""Tcy by which a robot may be ahead of the end of a quantum: it ends with a whole instruction."""

Shares = tuple[float, ...]
"""Of each pulse line: how far receivers have settled to its full light, 0 to 1."""


class Receivers(Structure):
    """`struct receivers` of light.c."""

    _fields_ = [("tau", c_double), ("settled", c_int64)]


class _Track(Structure):
    _fields_ = [("cycles", c_void_p), ("begun", c_void_p), ("lit", c_void_p), ("count", c_int64), ("known", c_int64),
                ("followed", c_double * LINES)]  # fmt: skip


@cache
def light_code() -> dict[str, Callable[..., Any]]:
    """Functions of light.c."""
    return functions(Path(__file__).with_name("light.c"), {
        "shares": (None, (ADDRESS, ADDRESS, INT, ADDRESS)),
        "light": (DOUBLE, (ADDRESS, INT, INT)),
    })  # fmt: skip


class Pulses:
    """The switches of a robot's pulse lines that may still matter, where compiled code sees them (`struct track`)."""

    def __init__(self, cycles: Sequence[int] = (), begun: Sequence[int] = (), lit: Sequence[int] = (0,)) -> None:
        """`begun`: per switch the cycle in which its transmission began; `lit`: the lines before the first switch and
        behind each."""
        self._track: Final = _Track(known=-1)
        self.address: Final = addressof(self._track)
        self._keep(max(_KEPT, len(cycles)), cycles, begun, lit)

    def _keep(self, room: int, cycles: Sequence[int], begun: Sequence[int], lit: Sequence[int]) -> None:
        """These, and room for so many."""
        self.cycles: Array[c_int64] = (c_int64 * room)(*cycles)
        self._begun: Array[c_int64] = (c_int64 * room)(*begun)
        self._lit: Array[c_uint8] = (c_uint8 * (room + 1))(*lit)
        self.count = len(cycles)
        track = self._track
        track.cycles, track.begun, track.lit = addressof(self.cycles), addressof(self._begun), addressof(self._lit)
        track.count = self.count

    def _last(self, first: int) -> tuple[list[int], list[int], list[int]]:
        """What `__init__` takes, of the switches from one on."""
        return self.cycles[first : self.count], self._begun[first : self.count], self._lit[first : self.count + 1]

    def __reduce__(self) -> tuple[type[Pulses], tuple[list[int], list[int], list[int]]]:
        """Other processes have them elsewhere in memory."""
        return Pulses, self._last(0)

    @property
    def lit(self) -> int:
        """Bit n: line n is lit behind the last switch."""
        return self._lit[self.count]

    def by(self, cycle: int) -> int:
        """How many switches were made at or before a cycle."""
        return bisect_right(self.cycles, cycle, 0, self.count)

    def lit_behind(self, count: int) -> int:
        """Bit n: line n is lit behind so many switches."""
        return self._lit[count]

    def add(self, cycle: int, line: int, lit: bool, needed_from: int) -> None:
        """A switch behind all others; what was before `needed_from` may be forgotten."""
        count, before = self.count, self._lit[self.count]
        if count == len(self.cycles):
            forgotten = max(self.by(needed_from) - 1, 0)
            self._keep(max(_KEPT, 2 * (count - forgotten)), *self._last(forgotten))
            count = self.count
        is_new = not count or (not before and cycle - self.cycles[count - 1] > PAUSE_S * FCY)
        self.cycles[count] = cycle
        self._begun[count] = cycle if is_new else self._begun[count - 1]
        self._lit[count + 1] = before | 1 << line if lit else before & ~(1 << line)
        self.count = self._track.count = count + 1


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
    _pulses: list[Pulses] = field(init=False)
    _led_cycles: list[list[int]] = field(init=False)
    _leds: list[list[int]] = field(init=False)
    _news: list[Switch] = field(init=False)
    receivers: Receivers = field(init=False)
    """How all robots' sensors follow the light."""

    def __post_init__(self) -> None:
        self._pulses = [Pulses() for _ in range(self.robots)]
        self._led_cycles = [[] for _ in range(self.robots)]
        self._leds = [[0] for _ in range(self.robots)]
        self._news = []
        self.receivers = Receivers(self.tau, round(SETTLED * self.tau))

    @classmethod
    def of(cls, scene: Scene) -> Ether:
        """That of a trial in a scene."""
        return cls(scene.robots.count, scene.clock.quantum_tcy, tau=scene.infrared.tau_us * 1e-6 * FCY)

    @property
    def late(self) -> int:
        """Tcy by which light arrives late."""
        return self.quantum + _OVERRUN

    def switch(self, robot: int, cycle: int, line: int, lit: bool) -> None:
        """A pulse line or LED of a robot is switched."""
        self._add(Switch(robot, cycle, line, lit))

    def _add(self, switch: Switch) -> None:
        robot, cycle, line, lit = switch
        needed_from = self._looked_back(min(cycle, self.slowest))
        self._news.append(switch)
        if line < LINES:
            self._pulses[robot].add(cycle, line, bool(lit), needed_from)
            return
        cycles, leds, led = self._led_cycles[robot], self._leds[robot], line - LINES
        state = leds[-1] | 1 << led if lit else leds[-1] & ~(1 << led)
        if len(cycles) > _KEPT and cycles[_KEPT // 2] < needed_from:
            del cycles[: _KEPT // 2], leds[: _KEPT // 2]
        cycles.append(cycle)
        leds.append(state)

    def _looked_back(self, cycle: int) -> int:
        """Cycle before which nothing matters any more to who asks about `cycle`."""
        return cycle - 4 * self.quantum - 2 * int(self.receivers.settled)

    def pulses(self, robot: int) -> Pulses:
        """What a robot's pulse lines did."""
        return self._pulses[robot]

    def shares(self, robot: int, cycle: int) -> Shares:
        """What others see of the light of a robot's pulse lines in a cycle of the trial: how it was a quantum ago,
        behind receivers of first order. The same for everybody, whenever it is asked."""
        found = (c_double * LINES)()
        asked = self._pulses[robot].address, addressof(self.receivers), cycle - self.late, addressof(found)
        light_code()["shares"](*asked)
        return tuple(found)

    def leds(self, robot: int, cycle: int) -> int:
        """What others see of a robot's LEDs in a cycle of the trial: bit n of those that were lit a quantum ago."""
        return self._leds[robot][bisect_right(self._led_cycles[robot], cycle - self.late)]

    def is_dark(self, robot: int, first: int, last: int) -> bool:
        """Whether others see no light of a robot from one cycle to another: its emitters are off and forgotten."""
        pulses, count = self._pulses[robot], self._pulses[robot].count
        forgotten = first - self.late - self.receivers.settled
        if not pulses.lit and (not count or pulses.cycles[count - 1] <= forgotten):
            return True  # at once, as it is most often
        index = pulses.by(last - self.late)
        return not pulses.lit_behind(index) and (not index or pulses.cycles[index - 1] <= forgotten)

    def take(self) -> list[Switch]:
        """What was added since the last call: what other processes have to hear."""
        news, self._news = self._news, []
        return news

    def hear(self, switches: Iterable[Switch]) -> None:
        """What robots of other processes did."""
        for switch in switches:
            self._add(switch)
