"""`NativeScheduler`: run all robots of a world in native code (lockstep.c), by one or several threads.

Input: the robots (`NativeRobot`), the addresses of their speeds and of the world. Output: which robot needs Python.
Between two steps of the world, robots share no state that changes, except that they append to the histories of their
emitters. So the record does not depend on which thread runs a robot.
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

from arena.robots.native_robot import NativeRobot
from emu.native_library import ADDRESS, INT, address_of, functions

REACHED, NEEDS_WORLD = -1, -2
"""Results of `NativeScheduler.run` other than a robot's number."""
_ALLOCATE: Final = PYFUNCTYPE(c_void_p)(("PyThread_allocate_lock", pythonapi))
_FREE: Final = PYFUNCTYPE(None, c_void_p)(("PyThread_free_lock", pythonapi))
_ACQUIRE: Final = PYFUNCTYPE(c_int, c_void_p, c_int)(("PyThread_acquire_lock", pythonapi))
_RELEASE: Final = PYFUNCTYPE(None, c_void_p)(("PyThread_release_lock", pythonapi))


class _Worker(Structure):
    """`struct worker` of lockstep.c."""

    _fields_ = [("lock", c_void_p), ("is_asleep", c_int64), ("runs", c_int64)]
    lock: int
    runs: int


class _Scheduler(Structure):
    """`struct scheduler` of lockstep.c."""

    _fields_ = [("count", c_int64), *((name, c_void_p) for name in ("robots", "speeds")), ("room", c_int64),
                ("native_world", c_void_p), *((name, c_int64) for name in ("world_goal", "worker_count")),
                *((name, c_void_p) for name in ("workers", "acquire", "release", "ready")),
                *((name, c_int64) for name in ("unclaimed", "finished", "round", "is_stopping"))]  # fmt: skip
    world_goal: int


class NativeScheduler:
    """Scheduler of `robots` and of the `struct native_world` at address `world`.

    `speeds` is the address of a table with the address of each robot's wheel speeds, `room` quanta of them. `threads`
    includes the thread of the caller.
    """

    def __init__(self, robots: Sequence[NativeRobot], speeds: int, room: int, world: int, threads: int = 1) -> None:
        count, workers = len(robots), max(min(threads, len(robots)) - 1, 0)
        self._robots: Final = (POINTER(NativeRobot) * count)(*map(pointer, robots))
        self._ready: Final = (c_void_p * count)()
        self._workers: Final = (_Worker * workers)(*(_Worker(_new_lock(), 0, 0) for _ in range(workers)))
        self._scheduler: Final = _Scheduler(
            count, addressof(self._robots), speeds, room, world, 0, workers, addressof(self._workers),
            cast(_ACQUIRE, c_void_p).value, cast(_RELEASE, c_void_p).value, addressof(self._ready),
        )  # fmt: skip
        self._address: Final = addressof(self._scheduler)
        self._run_all: Final = _code()["run_all"]
        stopped = Event()
        for worker in self._workers:
            Thread(target=_run_worker, args=(self._scheduler, self._workers, worker, stopped), daemon=True).start()
        finalize(self, _stop_workers, self._scheduler, stopped)

    def run(self, goal: int) -> int:
        """Run until `goal` quanta are over or Python is needed. Return the robot that needs Python, NEEDS_WORLD or
        REACHED."""
        needed: int = self._run_all(self._address, goal)
        return needed

    @property
    def worker_runs(self) -> int:
        """How many times a thread other than the caller's has run a robot."""
        return sum(worker.runs for worker in self._workers)

    @property
    def world_goal(self) -> int:
        """Tick to which the world must advance after NEEDS_WORLD."""
        return self._scheduler.world_goal


def _run_worker(scheduler: _Scheduler, workers: Array[_Worker], worker: _Worker, stopped: Event) -> None:
    """Run a worker thread to its end. Its arguments, `workers` among them, keep the memory it uses alive."""
    CFUNCTYPE(None, ADDRESS, ADDRESS)(address_of(_code()["worker_main"]))(addressof(scheduler), addressof(worker))
    stopped.wait()
    _FREE(worker.lock)


def _stop_workers(scheduler: _Scheduler, stopped: Event) -> None:
    """Let the worker threads end."""
    _code()["stop_workers"](addressof(scheduler))
    stopped.set()


def _new_lock() -> int:
    """Return a new lock of the Python library, already acquired."""
    lock: int = _ALLOCATE()
    _ACQUIRE(lock, 1)
    return lock


@cache
def _code() -> dict[str, Callable[..., Any]]:
    """Return the functions of lockstep.c."""
    return functions(Path(__file__).with_name("lockstep.c"), {
        "run_all": (INT, (ADDRESS, INT)), "worker_main": (None, (ADDRESS, ADDRESS)),
        "stop_workers": (None, (ADDRESS,)),
    })  # fmt: skip
