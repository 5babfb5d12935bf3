"""A debugger on one robot of a trial: while it stands, the whole world does; nothing that is recorded can tell.

Two greenlets: the trial's, in which the robot lives, and the debugger's. The robot's machine runs forward only in the
trial's, from cut to cut, so what it looks at comes from the world as always; in between the debugger decides how far.
What the robot has been shown is kept (`Shown`), so that its past is run again in the debugger's greenlet without the
world, which stays where it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, Final

import numpy as np
from greenlet import getcurrent, greenlet
from numpy.typing import NDArray

from arena.emulated import EmulatedBrain
from emu.debug.history import History, place
from emu.machine import Machine
from emu.stops import Stop

SENSORS: Final = range(8, 16)
"""Channels of the infrared sensors."""
OVER: Final = "the trial is over"
PAST: Final = "this is the past, and the other robots have seen what came of it: go back to the present to change it"


class GivenUpError(Exception):
    """Whoever debugs wants the trial to end."""


class Shown:
    """What a robot has been shown of the world, by cycle; told again when its past is run again."""

    def __init__(self, machine: Machine) -> None:
        self.keeps = True
        """False: what is shown from now on is not run again."""
        self._events: Final = machine.events
        self._ir: Final = machine.board.ir
        self._lines: Final[dict[int, NDArray[np.uint8]]] = {}
        self._levels: Final[dict[tuple[int, int], tuple[int, Any, Any]]] = {}
        camera, sources = machine.board.camera, machine.board.chip.adc.source
        camera.sample(partial(self._pixels, camera.sampled))
        for channel in SENSORS:
            sources[channel] = partial(self._level, channel, sources[channel])

    def _pixels(
        self, ask: Callable[[int, NDArray[np.intp], int], NDArray[np.uint8]], y: int, columns: NDArray[np.intp],
        cycle: int,
    ) -> NDArray[np.uint8]:  # fmt: skip
        if self._events.quiet:
            shown = self._lines.get(cycle)
            return shown if shown is not None else np.zeros((len(columns), 3), np.uint8)  # a way it never went
        shown = ask(y, columns, cycle)
        if self.keeps:
            self._lines[cycle] = shown
        return shown

    def _level(self, channel: int, ask: Callable[[int], int], cycle: int) -> int:
        """A sensor's level; what the board keeps of the light around it changes with the answer."""
        ir, key = self._ir, (channel, cycle)
        if self._events.quiet:
            if key not in self._levels:  # a way it never went
                return 0
            level, ir.reflection[:], ir.ambient[:] = self._levels[key]
            return level
        level = ask(cycle)
        if self.keeps:
            self._levels[key] = level, ir.reflection[:], ir.ambient[:]
        return level


class Recording(History):
    """A robot's history: its past by itself, its present with the world."""

    def __init__(self, debugged: Debugged, machine: Machine) -> None:
        super().__init__(machine)
        self._debugged: Final = debugged

    @property
    def frozen(self) -> str:
        return self._debugged.frozen or (PAST if self.is_past else "")

    def parted(self) -> None:
        """The robot is left alone until `met`."""
        self._ended = self.machine.snapshot()
        self.end = self.machine.cycle

    def met(self) -> None:
        """Something may have been done to it meanwhile."""
        self._notice()

    def _run_on(self, cycle: int) -> Stop | None:
        machine, stop = self.machine, None
        while stop is None and machine.cycle < cycle:
            stop = self._debugged.live(lambda limit: machine.run_until(min(cycle, limit)))
        return stop

    def _step_on(self) -> Stop | None:
        """A sleep is slept from cut to cut."""
        machine, stepped = self.machine, False
        before = place(machine)

        def one(limit: int) -> Stop | None:
            nonlocal stepped
            stop = machine.approach(limit)
            entered = stepped = place(machine) != before
            if entered or stop is not None or machine.cycle >= limit:
                return stop or machine.run_until(machine.cycle if entered else limit)
            stepped = True
            return machine.step()

        stop = None
        while stop is None and not stepped:
            stop = self._debugged.live(one)
        return stop

    @contextmanager
    def _silence(self) -> Iterator[None]:
        self.machine.pins.flush()  # what waits to be told is told while it counts
        with self.machine.board.motors.unremembered(), super()._silence():
            yield


class Debugged:
    """`brain`'s machine, run as `debugger` says: called in a greenlet of its own when the robot gets power, it makes
    a recording by `record`, and whether it comes back true the trial goes on without it. With `keeps` the trial is
    recorded, and must not be changed.
    """

    def __init__(self, brain: EmulatedBrain, debugger: Callable[[Debugged], bool], keeps: bool) -> None:
        self.machine: Final = brain.machine
        self.keeps: Final = keeps
        self.frozen: Final = "the trial is being recorded: leave out --out to change it" if keeps else ""
        self._shown: Final = Shown(self.machine)
        self._debugger: Final = greenlet(lambda _begins: debugger(self))
        self._robot: greenlet | None = None
        self._recording: Recording | None = None
        self._last = 0
        self._limit = 0
        self._cuts: list[int] = []
        self._ended: Stop | None = None
        self._plain: Final = self.machine.run_past
        machine = vars(self.machine)
        machine["run_past"], machine["end_at_cut"] = self._run_past, self._end_at_cut
        machine["cuts_so_far"] = lambda: self._cuts

    def record(self, machine: Machine) -> Recording:
        """The recording of what the debugger does."""
        self._recording = Recording(self, machine)
        return self._recording

    def live(self, act: Callable[[int], Stop | None]) -> Stop | None:
        """In the debugger's greenlet: let the robot do `act(limit)` in its own, and the world follow."""
        robot = self._robot
        if robot is None:
            return Stop("limit", self.machine.pc, self.machine.cycle, OVER)
        stop: Stop | None = robot.switch(act)
        return stop

    def over(self) -> None:
        """The trial is over: what is left is to look at the robot, and back."""
        self._robot = None
        if self._debugger and not self._debugger.dead:
            self._debugger.parent = getcurrent()
            self._debugger.switch(Stop("limit", self.machine.pc, self.machine.cycle, OVER))

    def _end_at_cut(self) -> None:
        self._last = min(self._last, self._limit)

    def _run_past(self, first: int, period: int, last: int, cuts: list[int]) -> Stop | None:
        """As `Machine.run_past`, in steps of the debugger's."""
        machine, began = self.machine, len(cuts)
        self._robot, self._cuts, self._last = getcurrent(), cuts, last
        self._debugger.parent = self._robot
        if self._recording is not None:
            self._recording.met()
        stop = None
        while True:
            self._limit = first + period * (len(cuts) - began)
            if stop is None and machine.cycle >= self._limit:
                cuts.append(machine.cycle)
                continue
            if stop is None and machine.cycle >= self._last:
                break
            ended = stop is not None and not (stop.reason == "breakpoint" and not stop.detail)
            act = self._debugger.switch(stop)
            if self._debugger.dead:
                self._release(act)
                return stop if ended else self._plain(self._limit, period, self._last, cuts)
            if ended:
                self._ended = stop
                break
            stop = act(min(self._limit, self._last))
            machine.pins.flush()
        if self._recording is not None:
            self._recording.parted()
        return self._ended

    def _release(self, goes_on: bool) -> None:
        """The debugger has left."""
        for name in ("run_past", "end_at_cut", "cuts_so_far"):
            del vars(self.machine)[name]
        self._recording, self._shown.keeps = None, False
        if not goes_on:
            raise GivenUpError
