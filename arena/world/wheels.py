"""`Wheels`: how fast a robot's wheels turned in each quantum, by the steps of its motors; where the physics reads it.

Single steps would jerk a drive of limited force, so a speed is that of a few quanta together. In: steps made by the
ends of quanta. Out: cm/s, kept for as long as nobody runs further ahead than `ROOM` quanta.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable
from ctypes import Structure, addressof, c_double, c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any, Final

from arena.scene import dimensions
from arena.scene.loader import FCY
from emu.native_library import ADDRESS, INT, address_of, functions

WINDOW_S: Final = 0.010
"""Motor steps are counted over at least this long to make a speed."""
ROOM: Final = 4096
"""Quanta that are kept."""


class _Drive(Structure):
    _fields_ = [*((name, c_int64) for name in ("room", "most", "filled", "newest")),
                *((name, c_void_p) for name in ("counts", "rates", "speeds"))]  # fmt: skip


@cache
def _turned() -> Callable[..., Any]:
    arguments = (ADDRESS, INT, INT, ADDRESS)
    return functions(Path(__file__).with_name("wheels.c"), {"turned": (None, arguments)})["turned"]


class Wheels:
    """Of one robot, whose quanta last `quantum` Tcy."""

    def __init__(self, quantum: int) -> None:
        window = max(round(WINDOW_S / (quantum / FCY)), 1)
        rates = [0.0, *(dimensions.CM_PER_STEP * FCY / (quantum * count) for count in range(1, window + 1))]
        self._counts: Final = (c_int64 * (2 * (window + 1)))()
        self._rates: Final = (c_double * (window + 1))(*rates)
        self._speeds: Final = (c_double * (2 * ROOM))()
        addresses = addressof(self._counts), addressof(self._rates), addressof(self._speeds)
        self._drive: Final = _Drive(ROOM, window + 1, 1, 0, *addresses)
        self._at: Final = addressof(self._drive)
        self._turned: Final = _turned()
        self.address: Final = addressof(self._speeds)
        """Speeds (left, right) of quantum n, at place n modulo ROOM."""

    def turned(self, first: int, steps: array[int]) -> None:
        """Quanta from `first` on are over, by whose ends the motors had made `steps`, left and right in turn."""
        self._turned(self._at, first, len(steps) >> 1, steps.buffer_info()[0])

    def lend(self) -> tuple[int, int]:
        """For compiled code: where `turned` of wheels.c is, and `struct drive`."""
        return address_of(self._turned), self._at

    def rested(self, tick: int) -> None:
        """A quantum is over in which the robot was off or stopped: nothing turns."""
        self._speeds[2 * (tick % ROOM)] = self._speeds[2 * (tick % ROOM) + 1] = 0.0

    def speed(self, tick: int) -> tuple[float, float]:
        """Left and right in cm/s during a quantum that is over."""
        left = 2 * (tick % ROOM)
        return self._speeds[left], self._speeds[left + 1]
