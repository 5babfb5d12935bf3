"""A debugger on one robot of a trial: while it stands, the whole world does; nothing that is recorded can tell.

Two greenlets: the trial's, in which the robot lives, and the debugger's. The robot's machine runs forward only in the
trial's, from cut to cut, so what it looks at comes from the world as always; in between the debugger decides how far.
What the robot has been shown is kept (`Shown`), so that its past is run again in the debugger's greenlet without the
world, which stays where it is until somebody looks at it, or changes what has been: then the trial leaves by an
exception, is run again from its seed up to the cycle in which the robot stands, and the debugger goes on with the new
robots, which are the old ones to the bit.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, Final

import numpy as np
from greenlet import getcurrent, greenlet
from numpy.typing import NDArray

from arena.robots.controller import Brain
from arena.robots.firmware_controller import EmulatedBrain
from arena.trial.snapshot import seen
from arena.world.physics import World
from emu.debug.history import History, place
from emu.machine.machine import Machine
from emu.machine.stops import Stop

SENSORS: Final = range(8, 16)
"""Channels of the infrared sensors."""
OVER: Final = "the trial is over"


class GivenUpError(Exception):
    """Whoever debugs wants the trial to end."""


class AnewError(Exception):
    """Whoever debugs wants the trial to be run again."""


class _Levels:
    """Levels of sensors by cycle and channel, and the light around the robot at each: about 20 bytes for one."""

    def __init__(self) -> None:
        self._cycles: Final = array("q")
        self._channels: Final = array("B")
        self._levels: Final = array("q")
        self._which: Final = array("L")
        self._lights: Final[list[bytes]] = []
        """Each that was different from the one before."""

    def add(self, cycle: int, channel: int, level: int, light: bytes) -> None:
        """The latest. What was later than that has never been."""
        while self._cycles and self._cycles[-1] > cycle:
            for column in (self._cycles, self._channels, self._levels, self._which):
                column.pop()
        if not self._lights or self._lights[-1] != light:
            self._lights.append(light)
        self._cycles.append(cycle)
        self._channels.append(channel)
        self._levels.append(level)
        self._which.append(len(self._lights) - 1)

    def find(self, cycle: int, channel: int) -> tuple[int, bytes] | None:
        """Level and light, if there was one."""
        for at in range(bisect_left(self._cycles, cycle), bisect_right(self._cycles, cycle)):
            if self._channels[at] == channel:
                return self._levels[at], self._lights[self._which[at]]
        return None


class Shown:
    """What a robot has been shown of the world, by cycle; told again when its past is run again."""

    def __init__(self, machine: Machine) -> None:
        self.keeps = True
        """False: what is shown from now on is not run again."""
        self._events: Final = machine.events
        self._ir: Final = machine.board.ir
        self._lines: Final[dict[int, NDArray[np.uint8]]] = {}
        self._levels: Final = _Levels()
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
        lights = self._ir.reflection, self._ir.ambient
        if self._events.quiet:
            found = self._levels.find(cycle, channel)
            if found is None:  # a way it never went
                return 0
            level, light = found
            half = len(light) // 2
            for around, kept in zip(lights, (light[:half], light[half:]), strict=True):
                around[:] = memoryview(kept).cast("B").cast(around.format)
            return level
        level = ask(cycle)
        if self.keeps:
            self._levels.add(cycle, channel, level, b"".join(around.tobytes() for around in lights))
        return level


class Recording(History):
    """A robot's history: its past by itself, its present with the world."""

    def __init__(self, debugged: Debugged, machine: Machine) -> None:
        super().__init__(machine)
        self._debugged: Final = debugged

    @property
    def frozen(self) -> str:
        return self._debugged.frozen

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
    """Robot number `robot` of a trial, run as `debugger` says: called in a greenlet of its own when the robot gets
    power, it makes a recording by `record`, and whether it comes back true the trial goes on without it. With `keeps`
    the trial is recorded, and must not be changed.

    Whoever runs the trial lets it `meet` world and robots first, and begins it again when that ends in AnewError.
    """

    def __init__(self, robot: int, debugger: Callable[[Debugged], bool], keeps: bool) -> None:
        self.keeps: Final = keeps
        self.frozen: Final = "the trial is being recorded: leave out --out to change it" if keeps else ""
        self._number: Final = robot
        self._debugger: Final = greenlet(lambda _begins: debugger(self))

    def meet(self, world: World, brains: Sequence[Brain]) -> None:
        """A trial begins, for the first time or again. Raises ValueError if the robot has no firmware."""
        brain = brains[self._number]
        if not isinstance(brain, EmulatedBrain):
            raise ValueError(f"--robot {self._number}: it has no firmware, its brain is scripted")
        self._world, self._brains = world, brains
        self._let_run_natively(False)
        self.machine = brain.machine
        self._shown = Shown(self.machine)
        self._trial: greenlet | None = None
        """Where the trial goes on; none before the robot gets power."""
        self._is_over = False
        self._recording: Recording | None = None
        self._last = self._limit = 0
        self._cuts: list[int] = []
        self._ended: Stop | None = None
        self._plain = self.machine.run_past
        machine = vars(self.machine)
        machine["run_past"], machine["end_at_cut"] = self._run_past, self._end_at_cut
        machine["cuts_so_far"] = lambda: self._cuts

    # In the debugger's greenlet

    def record(self, machine: Machine) -> Recording:
        """The recording of what the debugger does."""
        self._recording = Recording(self, machine)
        self._recording.around = self
        return self._recording

    def live(self, act: Callable[[int], Stop | None]) -> Stop | None:
        """Let the robot do `act(limit)` in its own greenlet, and the world follow."""
        if self._is_over or self._trial is None:
            return Stop("limit", self.machine.pc, self.machine.cycle, OVER)
        stop: Stop | None = self._trial.switch(act)
        return stop

    @property
    def keeps_moments(self) -> bool:
        """As `Around.keeps_moments`."""
        return False

    def anew(self, cycle: int, left: Any) -> Machine:
        """The trial begins again; the robot as it gets power."""
        assert self._trial is not None
        self._trial.switch(_begin_again)
        return self.machine

    def pass_by(self, near: int | None = None) -> None:
        """As `Around.pass_by`: nothing is kept."""

    @property
    def is_over(self) -> bool:
        """Whether the trial is."""
        return self._is_over

    @property
    def is_left(self) -> bool:
        """Whether the debugger has left."""
        return bool(self._debugger.dead)

    def seen(self) -> list[tuple[str, str]]:
        """Where everything is, and what the robots are at."""
        return seen(self._world, self._brains, self._number)

    # In the trial's greenlets

    def over(self) -> bool:
        """The trial is over: what is left is to look at the robot, and back. Whether the debugger has ever seen it.
        Raises AnewError."""
        self._is_over = True
        if self._recording is not None:
            self._recording.met()
        if self._debugger and not self._debugger.dead:
            self._trial = self._debugger.parent = getcurrent()
            self._debugger.switch(Stop("limit", self.machine.pc, self.machine.cycle, OVER))
            if not self._debugger.dead:
                raise AnewError
        return self.is_left

    def _let_run_natively(self, is_native: bool) -> None:
        """Whether compiled code runs all robots, or Python does (`EmulatedBrain.is_native`)."""
        for brain in self._brains:
            if isinstance(brain, EmulatedBrain):
                brain.is_native = is_native

    def _end_at_cut(self) -> None:
        self._last = min(self._last, self._limit)

    def _run_past(self, first: int, period: int, last: int, cuts: list[int]) -> Stop | None:
        """As `Machine.run_past`, in steps of the debugger's."""
        machine, began = self.machine, len(cuts)
        self._trial, self._cuts, self._last = getcurrent(), cuts, last
        self._debugger.parent = self._trial
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
            if act is _begin_again:
                raise AnewError
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
        self._let_run_natively(True)
        for name in ("run_past", "end_at_cut", "cuts_so_far"):
            del vars(self.machine)[name]
        self._recording, self._shown.keeps = None, False
        if not goes_on:
            raise GivenUpError


def _begin_again(_limit: int) -> Stop | None:
    """What the debugger's greenlet says instead of what the robot is to do."""
    raise AnewError
