"""`Wheels`: the wheel speeds of a robot in each quantum, computed from its motor steps.

Input: motor steps at the ends of quanta. Output: speeds in cm/s for the physics, of the last `ROOM` quanta. A speed is
the mean over a few quanta, because single steps would jerk a drive of limited force.
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
"""Time in s over which motor steps are averaged to a speed, at least one quantum."""
ROOM: Final = 4096
"""Number of quanta whose speeds are kept."""


class _Drive(Structure):
    """`struct drive` of wheels.c."""

    _fields_ = [*((name, c_int64) for name in ("room", "window", "filled", "newest")),
                *((name, c_void_p) for name in ("counts", "rates", "speeds"))]  # fmt: skip


@cache
def _add_steps() -> Callable[..., Any]:
    """Return `add_steps` of wheels.c."""
    arguments = (ADDRESS, INT, INT, ADDRESS)
    return functions(Path(__file__).with_name("wheels.c"), {"add_steps": (None, arguments)})["add_steps"]


class Wheels:
    """Wheel speeds of one robot, whose quanta last `quantum` Tcy."""

    def __init__(self, quantum: int) -> None:
        window = max(round(WINDOW_S / (quantum / FCY)), 1)
        rates = [0.0, *(dimensions.CM_PER_STEP * FCY / (quantum * count) for count in range(1, window + 1))]
        self._counts: Final = (c_int64 * (2 * (window + 1)))()
        self._rates: Final = (c_double * (window + 1))(*rates)
        self._speeds: Final = (c_double * (2 * ROOM))()
        addresses = addressof(self._counts), addressof(self._rates), addressof(self._speeds)
        self._drive: Final = _Drive(ROOM, window + 1, 1, 0, *addresses)
        self._at: Final = addressof(self._drive)
        self._add_steps: Final = _add_steps()
        self.address: Final = addressof(self._speeds)
        """Address of the speeds: (left, right) of quantum n at index n modulo ROOM."""

    def add_steps(self, first: int, steps: array[int]) -> None:
        """Add the motor steps at the ends of quanta from `first` on, left and right in turn."""
        self._add_steps(self._at, first, len(steps) >> 1, steps.buffer_info()[0])

    def native_handle(self) -> tuple[int, int]:
        """Return the addresses of `add_steps` of wheels.c and of the `struct drive`."""
        return address_of(self._add_steps), self._at

    def set_stopped(self, tick: int) -> None:
        """Set the speeds of a quantum in which the robot was off or its firmware stopped to zero."""
        self._speeds[2 * (tick % ROOM)] = self._speeds[2 * (tick % ROOM) + 1] = 0.0

    def speed(self, tick: int) -> tuple[float, float]:
        """Return left and right speed in cm/s during a finished quantum."""
        left = 2 * (tick % ROOM)
        return self._speeds[left], self._speeds[left + 1]
