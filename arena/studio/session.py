"""A trial in somebody's hands: it runs, stands, goes on by single quanta and back, while robots and things are moved.

In: a plan, a seed, and what is asked for on a line to another process. Out: rows as they come, the present moment, and
what one robot is doing inside. Everything that is done to the world is kept with its quantum, so a trial that is made
again from its seed, or from a copy of this process (moments.py), comes to the same state, to the byte.
"""

from __future__ import annotations

import os
import signal
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

from arena.campaign.campaign import Plan, brains_of
from arena.debug.attach import Handed
from arena.replay.page import samples_of
from arena.robots.firmware_controller import EmulatedBrain
from arena.scene.loader import SceneError
from arena.trial.checkpoints import CAN_COPY, Copies, GoneError, Line
from arena.trial.record import Trial
from arena.trial.snapshot import digest, place_of
from arena.trial.trial import Running

IDLE_S: Final = 0.05
"""For which a trial that stands waits before it looks whether it is to end."""
FRAMES: Final = 12
"""Frames of a call stack that are told."""


class RefusedError(ValueError):
    """What was asked for cannot be done now, or not at all."""


class Deed(NamedTuple):
    """What somebody did between two quanta, so that it can be done again: a method of `Stage`."""

    tick: int
    name: str
    arguments: tuple[Any, ...]

    def do(self, running: Running) -> None:
        getattr(running.stage, self.name)(*self.arguments)
        running.touched()


def serve(end: socket.socket, plan: Plan, seed: int) -> None:
    """`plan`'s trial number `seed` at the other end of a line, until that is closed. The first answer is what making
    the trial raised, if anything."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who asks
    with suppress(GoneError):
        InHand(plan, seed, Line(end)).live()
    os._exit(0)  # what a copy would clean up is not its own


class State(NamedTuple):
    """What was done until a moment that is to come again, and what is wanted then."""

    deeds: list[Deed]
    breaks: list[tuple[int, str]]
    epoch: int
    tick: int


class InHand:
    """`plan`'s trial number `seed`, told what to do on `line`."""

    def __init__(self, plan: Plan, seed: int, line: Line) -> None:
        self._plan: Final = plan
        self._seed: Final = seed
        self._line = line
        self._copies: Final = Copies()
        self._deeds: list[Deed] = []
        self._again: deque[Deed] = deque()
        self._goal: int | None = None
        self._returned = False
        """The robot that was given to a debugger is wanted back."""
        self._pace = 1.0
        self._breaks: dict[tuple[int, str], Callable[[], None]] = {}
        self._held = ""
        self._broken = ""
        self._hold = False
        self._handed: Handed | None = None
        self._is_altered = False
        """A debugger may have changed what would not be changed again."""
        self._ended = False
        self.epoch = 0
        """How often the trial was begun anew: samples of another one are not those of this."""

    # -- what can be asked for ---------------------------------------------------------------------------------------

    def go(self, pace: float = 1.0) -> None:
        """Run until told otherwise, at most `pace` times as fast as real time. Leaves a breakpoint."""
        if not pace > 0:
            raise RefusedError(f"{pace} times as fast as real time: expected a positive number")
        self._able()
        if not self._held:
            self._own()
        self._pace, self._hold = pace, False
        self._goal = self._running.quanta

    def stand(self) -> None:
        """Stand still at the end of this quantum. On the way back, what was done later is forgotten."""
        self._own()
        self._goal = None
        self._forget(self._running.world.ticks)

    def step(self, quanta: int = 1) -> None:
        """Let some quanta be over."""
        self._free()
        self._able()
        if quanta < 1:
            raise RefusedError(f"{quanta} quanta: expected 1 or more")
        self._forget(self._running.world.ticks)
        self._pace, self._goal = 0.0, min(self._running.world.ticks + quanta, self._running.quanta)

    def back(self, tick: int) -> None:
        """Back, or forth, to the moment at which `tick` quanta were over: by beginning anew with the same seed, doing
        again what was done until then. What was done later is forgotten."""
        self._may_go_to(tick)
        self._forget(tick)
        if tick < self._running.world.ticks:
            self._begin()
            self._again = deque(self._deeds)
            self._do_again()
        self._pace, self._goal = 0.0, tick

    def leave(self, tick: int) -> State | None:
        """What a copy of this process must know that is to go on to `tick` in its place; none if that is yet to
        come."""
        self._may_go_to(tick)
        if tick >= self._running.world.ticks:
            return None
        return State([one for one in self._deeds if one.tick <= tick], list(self._breaks), self.epoch + 1, tick)

    def keep(self, state: State | None = None) -> Line | None:
        """A line to a copy of this process, which sleeps until it is told to `keep` itself and go on with `state`; none
        if there is no room for one."""
        while True:
            try:
                line, is_copy = self._copies.make()
            except OSError:
                line, is_copy = None, False
            if not is_copy:
                if state is not None:
                    self._take_over(state)
                return line
            assert line is not None
            self._line.drop()
            self._line = line
            ((_, (state,), _),), _ = self._line.receive()

    def move(self, kind: str, number: int, x: float, y: float) -> None:
        """Put a robot or an object somewhere else; cm."""
        self._free()
        if kind not in ("robot", "object"):
            raise RefusedError(f"{kind!r} cannot be moved; expected robot or object")
        if not 0 <= number < len(getattr(self._running.world, f"{kind}s")):
            raise RefusedError(f"there is no {kind} {number}")
        self._do(f"move_{kind}", number, x, y)

    def tell(self, robot: int, text: str) -> None:
        """Send a robot something by Bluetooth."""
        self._free()
        self._brain(robot)
        try:
            text.encode("latin-1")
        except UnicodeEncodeError:
            raise RefusedError("Bluetooth carries bytes: letters of Latin-1 only") from None
        self._do("tell", robot, text)

    def stop_at(self, robot: int, place: str) -> None:
        """Let the whole world stand still when a robot comes to a function, until `go`; again = no more."""
        machine = self._emulated(robot).machine
        key = robot, place
        if key in self._breaks:
            self._breaks.pop(key)()
            return
        try:
            self._breaks[key] = machine.hook_pc(place, lambda *_: self._stands_at(robot, place))
        except (KeyError, ValueError) as error:
            raise RefusedError(f"robot {robot}: {error.args[0]}") from None

    def debug(self, robot: int) -> None:
        """Give a robot to a debugger, or take it back: `now` says on which port of this machine one client is served.
        The world moves only as the client lets the robot move; then it stands. What a debugger changes in a robot is
        not done again on the way back."""
        if self._handed is not None and not self._held:
            self._returned = True
            return
        self._free()
        self._able()
        if self._running.is_over:
            raise RefusedError("the trial is over")
        if self._emulated(robot).has_stopped:
            raise RefusedError(f"robot {robot}: its firmware has stopped; go back first")
        self._forget(self._running.world.ticks)
        self._returned = False
        try:
            self._handed = Handed(robot, self._idle)
        except OSError as error:
            raise RefusedError(f"no port for a debugger: {error.strerror}") from None
        self._handed.meet(self._running.world, self._running.brains)
        self._pace, self._goal = 0.0, self._running.quanta

    def now(self) -> dict[str, Any]:
        """The present moment: cm, rad, s."""
        world, handed = self._running.world, self._handed
        return {
            "tick": world.ticks, "t": world.seconds, "epoch": self.epoch, "quanta": self._running.quanta,
            "robots": world.poses.robots, "objects": world.poses.objects, "held": self._held,
            "breaks": [f"{robot} {place}" for robot, place in self._breaks],
            "debugger": {"robot": handed.robot, "port": handed.port, "is_met": handed.is_met} if handed else None,
            "state": f"cannot go on: {self._broken}" if self._broken
                     else "at a breakpoint" if self._held else "in a debugger" if handed
                     else "over" if self._running.is_over
                     else "standing" if self._goal is None else "going back" if self._again else "running",
        }  # fmt: skip

    def more(self, first: int, epoch: int) -> dict[str, Any]:
        """Samples from `first` on, or all if those are of another epoch, and `now`."""
        columns = self._running.result.rows.columns
        begin = first if epoch == self.epoch else 0
        about = self._about | {"faults": [list(fault) for fault in self._running.result.faults]}
        found: dict[str, Any] = {}
        if begin < len(columns["t"]):
            rows = {name: values[begin:] for name, values in columns.items()}
            found = samples_of(Trial(Path("studio"), rows, about))
        return found | {"from": begin, "now": self.now()}

    def trial(self) -> Trial:
        """What is recorded so far."""
        faults = [list(fault) for fault in self._running.result.faults]
        columns = {name: list(values) for name, values in self._running.result.rows.columns.items()}
        return Trial(Path("studio"), columns, self._about | {"faults": faults})

    def inside(self, robot: int) -> dict[str, Any]:
        """What one robot is doing: registers, call stack, threads. A script has nothing inside."""
        brain = self._brain(robot)
        if not isinstance(brain, EmulatedBrain):
            return {"robot": robot, "script": True}
        machine = brain.machine
        return {
            "robot": robot, "pc": machine.pc, "place": place_of(machine), "cycle": machine.cycle,
            "sr": machine.peek("SR"),
            "asleep": machine.is_asleep, "w": [machine.peek(f"W{n}") for n in range(16)],
            "frames": [str(frame) for frame in machine.backtrace()[:FRAMES]],
            "threads": [{"name": one.name, "pid": one.pid, "state": one.state, "used": one.used,
                         "size": one.stack and one.stack[1] - one.stack[0]} for one in machine.threads()],
        }  # fmt: skip

    def digest(self) -> str:
        """SHA-256 of everything that lives: bodies with their speeds, and every machine's whole state."""
        return digest(self._running.world, self._running.brains)

    # -- life --------------------------------------------------------------------------------------------------------

    def live(self) -> None:
        """Until the line is closed. Raises GoneError if that was before there was a trial."""
        self._made: AbstractContextManager[Any] | None = None
        try:
            self._begin()
        except Exception as error:
            self._line.send((error,))
            return
        self._reply([])
        while not self._ended:
            if self._goal is None or self._running.is_over or self._running.world.ticks >= self._goal:
                self._goal = None
                self._answer(IDLE_S)
            else:
                try:
                    self._go_on()
                except Exception as error:  # a supervisor's, most often: the moment before can still be looked at
                    self._goal, self._broken = None, f"{error}"
        self._close()

    def _go_on(self) -> None:
        """To the next sample, or where something is to be done, no faster than wanted."""
        assert self._goal is not None
        running, start, before = self._running, time.monotonic(), self._running.world.seconds
        if self._handed is not None:
            running.go_on(running.world.ticks + 1)
            if running.is_over:
                self._handed.over()
                self._handed.close()
            if self._handed.is_back:
                self._is_altered |= self._handed.is_met
                self._handed, self._goal = None, None
            return
        running.go_on(min(self._goal, self._again[0].tick) if self._again else self._goal)
        self._do_again()
        self._answer(0)
        while self._pace and not self._ended and self._goal is not None:
            left = (running.world.seconds - before) / self._pace - (time.monotonic() - start)
            if left <= 0:
                break
            self._answer(min(left, IDLE_S))

    def _answer(self, wait: float) -> None:
        """Do what is asked for; wait for it so many seconds at most."""
        try:
            if not self._line.is_ready(wait):
                return
            calls, _ = self._line.receive()
            try:
                results = [getattr(self, name)(*arguments, **named) for name, arguments, named in calls]
            except GoneError:
                raise
            except Exception as error:
                self._line.send((error,))
                return
            self._reply(results)
        except GoneError:
            self._ended, self._hold = True, False

    def _reply(self, results: list[Any]) -> None:
        end = results[0] if results and isinstance(results[0], Line) else None
        world, plain = self._running.world, not (self._held or self._handed or self._broken or self._is_altered)
        about = world.ticks, world.seconds, CAN_COPY and plain
        self._line.send((None, [] if end else results, about), end)
        if end is not None:
            end.drop()

    def _idle(self, wait: float) -> bool:
        """Answer while a debugger has a robot; whether it may keep it."""
        self._answer(wait)
        return not (self._ended or self._returned)

    def _begin(self) -> None:
        self._close()
        self._broken, self._is_altered = "", False
        made = brains_of(self._plan, self._seed, 1)
        brains, _, ether = made.__enter__()
        self._made = made
        plan = self._plan
        self._running = Running(plan.scene, self._seed, brains, plan.seconds, ether=ether, experiment=plan.to_do)
        self._about: dict[str, Any] = plan.key() | {"seed": self._seed}
        self.epoch += 1
        again, self._breaks = list(self._breaks), {}
        for robot, place in again:
            self.stop_at(robot, place)

    def _close(self) -> None:
        if self._made is not None:
            self._made.__exit__(None, None, None)
            self._made = None

    def _take_over(self, state: State) -> None:
        """Go on in the place of a process that was further."""
        done = len(self._deeds) - len(self._again)
        self._deeds, self._again = state.deeds, deque(state.deeds[done:])
        self.epoch, self._pace, self._goal = state.epoch, 0.0, state.tick
        gone, new = set(self._breaks) - set(state.breaks), [one for one in state.breaks if one not in self._breaks]
        for robot, place in (*gone, *new):
            self.stop_at(robot, place)
        self._do_again()

    def _do(self, name: str, *arguments: Any) -> None:
        """Do something to the world, and keep it. Raises RefusedError where the scene has no room for it."""
        if self._again:
            raise RefusedError("the trial is on its way back; let it stand first")
        deed = Deed(self._running.world.ticks, name, arguments)
        try:
            deed.do(self._running)
        except SceneError as error:
            raise RefusedError(str(error)) from None
        self._deeds.append(deed)

    def _forget(self, tick: int) -> None:
        """What was done after `tick` quanta was never done."""
        self._deeds = [deed for deed in self._deeds if deed.tick <= tick]
        self._again = deque(deed for deed in self._again if deed.tick <= tick)

    def _do_again(self) -> None:
        while self._again and self._again[0].tick <= self._running.world.ticks:
            self._again.popleft().do(self._running)

    def _stands_at(self, robot: int, place: str) -> bool:
        """A robot has come to a breakpoint, in the middle of a quantum: whatever is asked for now is answered here."""
        if self._again or self._ended or self._emulated(robot).machine.events.quiet:
            return False
        self._held, self._hold = f"robot {robot} is at {place}", True
        while self._hold:
            self._answer(IDLE_S)
        self._held = ""
        return False

    def _may_go_to(self, tick: int) -> None:
        self._free()
        if not 0 <= tick <= self._running.quanta:
            raise RefusedError(f"quantum {tick}: the trial has those from 0 to {self._running.quanta}")

    def _free(self) -> None:
        if self._held:
            raise RefusedError(f"{self._held}; let it go on first")
        self._own()

    def _own(self) -> None:
        if self._handed is not None:
            raise RefusedError(f"a debugger has robot {self._handed.robot}; let it leave first")

    def _able(self) -> None:
        if self._broken:
            raise RefusedError(f"the trial cannot go on ({self._broken}); go back first")

    def _brain(self, robot: int) -> Any:
        if not 0 <= robot < len(self._running.brains):
            raise RefusedError(f"there is no robot {robot}")
        return self._running.brains[robot]

    def _emulated(self, robot: int) -> EmulatedBrain:
        brain = self._brain(robot)
        if not isinstance(brain, EmulatedBrain):
            raise RefusedError(f"robot {robot} is a script: it has no firmware to stop in")
        return brain
