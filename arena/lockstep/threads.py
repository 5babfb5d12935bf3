"""`Swarm`: all robots of a world, run in compiled code (lockstep.c) by as many threads as there are cores for it.

In: robots as compiled code knows them (`Ahead`), where their speeds and the world are. Out: for whom Python is needed.
Which thread runs a robot cannot show: between two steps of the world a robot touches nothing but itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import (
    CFUNCTYPE,
    POINTER,
    PYFUNCTYPE,
    Array,
    Structure,
    addressof,
    c_int,
    c_int64,
    c_void_p,
    cast,
    pointer,
    pythonapi,
)
from functools import cache
from pathlib import Path
from threading import Event, Thread
from typing import Any, Final
from weakref import finalize

from arena.robots.native_robot import Ahead
from emu.native_library import ADDRESS, INT, address_of, functions

OVER, WORLD = -1, -2
"""Results of `Swarm.run` that are no robot's number."""
_ALLOCATE: Final = PYFUNCTYPE(c_void_p)(("PyThread_allocate_lock", pythonapi))
_FREE: Final = PYFUNCTYPE(None, c_void_p)(("PyThread_free_lock", pythonapi))
_ACQUIRE: Final = PYFUNCTYPE(c_int, c_void_p, c_int)(("PyThread_acquire_lock", pythonapi))
_RELEASE: Final = PYFUNCTYPE(None, c_void_p)(("PyThread_release_lock", pythonapi))


class _Helper(Structure):
    """`struct helper`."""

    _fields_ = [("lock", c_void_p), ("sleeps", c_int64), ("runs", c_int64)]
    lock: int
    runs: int


class _Swarm(Structure):
    """`struct swarm`."""

    _fields_ = [("count", c_int64), *((name, c_void_p) for name in ("robots", "speeds")), ("room", c_int64),
                ("ground", c_void_p), *((name, c_int64) for name in ("wanted", "helpers")),
                *((name, c_void_p) for name in ("helper", "acquire", "release", "ready")),
                *((name, c_int64) for name in ("left", "through", "rounds", "is_over"))]  # fmt: skip
    wanted: int


class Swarm:
    """`robots` of the world that compiled code knows at `ground`, whose wheels' speeds lie at `speeds` (of each robot,
    `room` quanta of them), run by so many `threads`, of which the caller's is one."""

    def __init__(self, robots: Sequence[Ahead], speeds: int, room: int, ground: int, threads: int = 1) -> None:
        count, helping = len(robots), max(min(threads, len(robots)) - 1, 0)
        self._aheads: Final = (POINTER(Ahead) * count)(*map(pointer, robots))
        self._ready: Final = (c_void_p * count)()
        self._helpers: Final = (_Helper * helping)(*(_Helper(_new_lock(), 0, 0) for _ in range(helping)))
        self._swarm: Final = _Swarm(
            count, addressof(self._aheads), speeds, room, ground, 0, helping, addressof(self._helpers),
            cast(_ACQUIRE, c_void_p).value, cast(_RELEASE, c_void_p).value, addressof(self._ready),
        )  # fmt: skip
        self._at: Final = addressof(self._swarm)
        self._run_all: Final = _code()["run_all"]
        gone = Event()
        for helper in self._helpers:
            Thread(target=_help, args=(self._swarm, self._helpers, helper, gone), daemon=True).start()
        finalize(self, _dismiss, self._swarm, gone)

    def run(self, goal: int) -> int:
        """Until `goal` quanta are over, or Python is needed: for the robot with that number, or for the WORLD."""
        needed: int = self._run_all(self._at, goal)
        return needed

    @property
    def helped(self) -> int:
        """How often another thread has run a robot."""
        return sum(helper.runs for helper in self._helpers)

    @property
    def wanted(self) -> int:
        """How far the WORLD is to go, in quanta."""
        return self._swarm.wanted


def _help(swarm: _Swarm, helpers: Array[_Helper], helper: _Helper, gone: Event) -> None:
    """The life of a thread. What it was given is kept until it ends, `helpers` among it."""
    CFUNCTYPE(None, ADDRESS, ADDRESS)(address_of(_code()["help"]))(addressof(swarm), addressof(helper))
    gone.wait()
    _FREE(helper.lock)


def _dismiss(swarm: _Swarm, gone: Event) -> None:
    """Let the threads end."""
    _code()["dismiss"](addressof(swarm))
    gone.set()


def _new_lock() -> int:
    """One of Python's locks, taken."""
    lock: int = _ALLOCATE()
    _ACQUIRE(lock, 1)
    return lock


@cache
def _code() -> dict[str, Callable[..., Any]]:
    return functions(Path(__file__).with_name("lockstep.c"), {
        "run_all": (INT, (ADDRESS, INT)), "help": (None, (ADDRESS, ADDRESS)), "dismiss": (None, (ADDRESS,)),
    })  # fmt: skip
