"""`OpticalChannel`: the states over time of all robots' infrared emitters and LEDs, as other robots receive them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from ctypes import Array, Structure, addressof, c_double, c_int64, c_uint8, c_void_p
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final

from arena.scene.loader import FCY, Scene
from emu.boards.epuck.analog import PULSE_PINS, TAU_SECONDS
from emu.native_library import ADDRESS, DOUBLE, INT, functions

LINES: Final = len(PULSE_PINS)
SETTLED: Final = 16.0
"""Time constants after which a change of an emitter has no more effect: e^-16 of full light is 4e-4 counts."""
GAP_S: Final = 0.0155
"""Darkness after which light counts as another transmission.

No frame of the firmware's link is dark for so long: no word begins with more than 11 zeros or ends with more than 10,
and 21 bits last 15.4 ms (firmware/openswarm/io/infrared).
"""
_ROOM: Final = 256
"""Initial capacity of a history, in changes."""
_OVERRUN: Final = 64
"""Tcy by which a robot can pass the end of a quantum, which ends with a whole instruction."""

Levels = tuple[float, ...]
"""Response of a receiver to each pulse line, from 0 (dark) to 1 (settled at full light)."""


class Receivers(Structure):
    """`struct receivers` of light.c."""

    _fields_ = [("tau", c_double), ("settled", c_int64), ("gap", c_double)]


class _History(Structure):
    """`struct history` of light.c."""

    _fields_ = [*((name, c_void_p) for name in ("cycles", "begun", "levels", "lit")), ("room", c_int64),
                ("count", c_int64)]  # fmt: skip
    count: int


class Emission(Structure):
    """`struct emission` of light.c."""

    _fields_ = [("history", c_void_p), ("receivers", c_void_p), ("on_at", c_int64)]


@cache
def light_code() -> dict[str, Callable[..., Any]]:
    """Return the functions of light.c."""
    return functions(Path(__file__).with_name("light.c"), {
        "append": (INT, (ADDRESS, ADDRESS, INT, INT, INT)),
        "changes_by": (INT, (ADDRESS, INT)),
        "emit": (INT, (ADDRESS, INT, INT, INT)),
        "is_dark": (INT, (ADDRESS, ADDRESS, INT, INT)),
        "levels": (None, (ADDRESS, ADDRESS, INT, ADDRESS)),
        "light": (DOUBLE, (ADDRESS, INT, INT)),
        "sense": (None, (ADDRESS, INT)),
        "begin_quantum": (INT, (ADDRESS, ADDRESS, INT)),
    })  # fmt: skip


class EmitterHistory:
    """Recent changes of a robot's pulse lines, in memory that native code reads (`struct history`)."""

    def __init__(
        self, cycles: Sequence[int] = (), begun: Sequence[int] = (), levels: Sequence[float] = (),
        lit: Sequence[int] = (0,),
    ) -> None:  # fmt: skip
        """Create a history.

        `begun`: per change the cycle at which its transmission began. `levels`: for each change the levels of all lines
        at its cycle. `lit`: the lit lines before the first change and after each.
        """
        self._history: Final = _History()
        self.address: Final = addressof(self._history)
        self._allocate(max(_ROOM, 2 * len(cycles)), cycles, begun, levels, lit)

    def _allocate(
        self, room: int, cycles: Sequence[int], begun: Sequence[int], levels: Sequence[float], lit: Sequence[int]
    ) -> None:
        """Allocate room for `room` changes and copy these into it."""
        self._cycles: Array[c_int64] = (c_int64 * room)(*cycles)
        self._begun: Array[c_int64] = (c_int64 * room)(*begun)
        self._levels: Array[c_double] = (c_double * (LINES * room))(*levels)
        self._lit: Array[c_uint8] = (c_uint8 * (room + 1))(*lit)
        history = self._history
        history.cycles, history.begun = addressof(self._cycles), addressof(self._begun)
        history.levels, history.lit = addressof(self._levels), addressof(self._lit)
        history.room, history.count = room, len(cycles)

    def _since(self, first: int) -> tuple[list[int], list[int], list[float], list[int]]:
        """Return the changes from number `first` on, as arguments of `__init__`."""
        kept = slice(first, self.count)
        levels = self._levels[LINES * first : LINES * self.count]
        return self._cycles[kept], self._begun[kept], levels, self._lit[first : self.count + 1]

    def __reduce__(self) -> tuple[type[EmitterHistory], tuple[list[int], list[int], list[float], list[int]]]:
        """Copy and pickle by value: the addresses are valid in one process only."""
        return EmitterHistory, self._since(0)

    @property
    def count(self) -> int:
        """Number of changes that are kept."""
        return self._history.count

    def add(self, receivers: Receivers, cycle: int, line: int, lit: bool, needed_from: int) -> None:
        """Append a change. Changes before cycle `needed_from` can be dropped."""
        if not light_code()["append"](self.address, addressof(receivers), cycle, line, lit):
            dropped = max(light_code()["changes_by"](self.address, needed_from) - 1, 0)
            self._allocate(max(_ROOM, 2 * (self.count - dropped)), *self._since(dropped))


@dataclass
class OpticalChannel:
    """The infrared emitters and LEDs of `robots` robots over the cycles of the trial."""

    robots: int
    quantum: int
    horizon: int = 1 << 62
    """Cycle of the trial that all robots have reached. Light more than four quanta older is not needed."""
    tau: float = TAU_SECONDS * FCY
    """Time constant of the receivers in Tcy."""
    _emitters: list[EmitterHistory] = field(init=False)
    _led_cycles: list[list[int]] = field(init=False)
    _leds: list[list[int]] = field(init=False)
    receivers: Receivers = field(init=False)
    """Response of all infrared sensors to light."""

    def __post_init__(self) -> None:
        self._emitters = [EmitterHistory() for _ in range(self.robots)]
        self._led_cycles = [[] for _ in range(self.robots)]
        self._leds = [[0] for _ in range(self.robots)]
        self.receivers = Receivers(self.tau, round(SETTLED * self.tau), GAP_S * FCY)

    @classmethod
    def of(cls, scene: Scene) -> OpticalChannel:
        """Return the channel of a new trial of a scene."""
        return cls(scene.robots.count, scene.clock.quantum_tcy, tau=scene.infrared.tau_us * 1e-6 * FCY)

    @property
    def delay(self) -> int:
        """Delay in Tcy with which a robot receives light."""
        return self.quantum + _OVERRUN

    def switch(self, robot: int, cycle: int, line: int, lit: bool) -> None:
        """Record that a pulse line of a robot is switched. Numbers from `LINES` on are the robot's LEDs."""
        needed_from = min(cycle, self.horizon) - 4 * self.quantum - 2 * int(self.receivers.settled)
        if line < LINES:
            self._emitters[robot].add(self.receivers, cycle, line, lit, needed_from)
            return
        cycles, leds, led = self._led_cycles[robot], self._leds[robot], line - LINES
        state = leds[-1] | 1 << led if lit else leds[-1] & ~(1 << led)
        if len(cycles) > _ROOM and cycles[_ROOM // 2] < needed_from:
            del cycles[: _ROOM // 2], leds[: _ROOM // 2]
        cycles.append(cycle)
        leds.append(state)

    def emitter(self, robot: int) -> EmitterHistory:
        """Return the history of a robot's pulse lines."""
        return self._emitters[robot]

    def emitter_addresses(self) -> Array[c_void_p]:
        """Return the host addresses of all robots' histories."""
        return (c_void_p * len(self._emitters))(*(one.address for one in self._emitters))

    def levels(self, robot: int, cycle: int) -> Levels:
        """Return the response of other robots' receivers to a robot's pulse lines at a cycle of the trial.

        The receivers are first-order low-passes, and light reaches them one quantum late. All receive the same levels.
        """
        found = (c_double * LINES)()
        arguments = self._emitters[robot].address, addressof(self.receivers), cycle - self.delay, addressof(found)
        light_code()["levels"](*arguments)
        return tuple(found)

    def leds(self, robot: int, cycle: int) -> int:
        """Return the LEDs of a robot as others see them at a cycle of the trial: bit n for LED n, one quantum late."""
        return self._leds[robot][bisect_right(self._led_cycles[robot], cycle - self.delay)]

    def is_dark(self, robot: int, first: int, last: int) -> bool:
        """Whether others receive no light of a robot from cycle `first` to `last`."""
        arguments = self._emitters[robot].address, addressof(self.receivers), first - self.delay, last - self.delay
        return bool(light_code()["is_dark"](*arguments))
