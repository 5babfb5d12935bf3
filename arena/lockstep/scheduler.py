"""Demand lock-step: robots run ahead until they look at something, the world follows the slowest of them.

A robot whose firmware reads a line of its camera needs poses of that quantum; the world can only tell them when all
robots have lived until then. So each robot is a greenlet: one that looks is left where it stands, in the middle of its
run, until the others have come as far. Nothing that is recorded can tell this from quantum after quantum: a robot sees
the same poses either way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import addressof, c_void_p
from functools import partial
from typing import Final, Protocol, runtime_checkable

from greenlet import getcurrent, greenlet

from arena.infrared.channel import Ether
from arena.lockstep.threads import OVER, WORLD, Swarm
from arena.robots.native_robot import AWAY, LOOKS, RUNS, Ahead
from arena.world.physics import Poses, Stretch, World
from arena.world.wheels import ROOM, Wheels


@runtime_checkable
class Runner(Protocol):
    """A robot that can run ahead: `arena.robots.firmware_controller.EmulatedBrain`."""

    lived: int
    """Quanta that are over for it."""

    def live(self, ticks: int) -> None:
        """Live until so many quanta are over."""

    wheels: Wheels
    """How fast they turned in quanta that are over."""

    ahead: Ahead
    """What compiled code knows of it."""

    def lend(self, ride: Callable[[], int]) -> None:
        """Let `ride` run native code from now on, where there is any: called in the greenlet in which the robot lives,
        it gives what native code came back for."""

    def join(self, look_at: Callable[[int], tuple[Poses, Poses]]) -> None:
        """Get poses from `look_at` from now on: those at the beginning of a quantum, and a quantum before. All quanta
        before it must be over for the robot when it asks."""


class LockStep:
    """`world`, the robots that are in it, all of them, and what carries their infrared light. So many `threads` run
    native code. Without `is_native` Python runs it and the world and sees each look: the same, more slowly.
    """

    def __init__(
        self, world: World, robots: Sequence[Runner], ether: Ether | None = None, is_native: bool = True,
        threads: int = 1,
    ) -> None:  # fmt: skip
        self._world: Final = world
        self._robots: Final = robots
        self._ether: Final = ether or Ether.of(world.scene)
        self._ether.slowest = 0
        self._past: Final[dict[int, Poses]] = {world.ticks: world.poses}
        self._stretches: list[Stretch] = []
        self._is_native: Final = is_native
        self._hub: greenlet = getcurrent()
        self._lives: list[greenlet | None] = [None] * len(robots)
        self._is_left = False
        self._speeds: Final = (c_void_p * len(robots))(*(robot.wheels.address for robot in robots))
        self._speeds_at: Final = addressof(self._speeds)
        aheads = [robot.ahead for robot in robots]
        self.swarm: Final = Swarm(aheads, self._speeds_at, ROOM, addressof(world.ground), threads)
        for place, robot in enumerate(robots):
            robot.join(self.look_at)
            if is_native:
                robot.lend(partial(self._ride, place))

    def advance(self, ticks: int) -> list[tuple[float, float]]:
        """Let so many quanta be over for everybody; wheel speeds of the last of them. Raises RuntimeError if an
        exception has ended an earlier call: robots were left in the middle of a run."""
        if self._is_left:
            raise RuntimeError("an exception has left robots in the middle of a quantum: begin another trial")
        try:
            while self._world.ticks < ticks:
                self._live(min(ticks, self._world.ticks + ROOM))
        except BaseException:
            self._leave()
            raise
        return [robot.wheels.speed(ticks - 1) for robot in self._robots]

    def _leave(self) -> None:
        """Let no robot stay in the middle of its run: its greenlet would keep it, and all others, for ever."""
        self._is_left = True
        for life in self._lives:
            if life is not None:
                life.throw()
        self._lives = [None] * len(self._lives)

    def _live(self, ticks: int) -> None:
        """As `advance`, at most ROOM quanta."""
        self._hub = getcurrent()
        for place, robot in enumerate(self._robots):
            robot.ahead.stands = AWAY
            if robot.lived < ticks:
                self._lives[place] = greenlet(robot.live)
                self._go_on(place, ticks)
        while (needed := self._next(ticks)) != OVER:
            if needed == WORLD:
                self._step_to(self.swarm.wanted)
            else:
                self._go_on(needed, self._robots[needed].ahead.why)
        for tick in [tick for tick in self._past if tick < ticks - 1]:
            del self._past[tick]
        self._stretches = [stretch for stretch in self._stretches if stretch.last >= ticks - 1]

    def _next(self, ticks: int) -> int:
        """Run all robots in compiled code, and the world behind them, until Python is needed; for whom."""
        world = self._world
        world.lend(self._poses(world.ticks), self._poses(world.ticks - 1), self._is_native)
        needed = self.swarm.run(ticks)
        self._note(world.take())
        return needed

    def _go_on(self, place: int, answer: int) -> None:
        """Let Python go on with a robot until it is to be run, waits for poses, or is through."""
        life, ahead = self._lives[place], self._robots[place].ahead
        assert life is not None
        tick = life.switch(answer)
        if life.dead:
            self._lives[place] = None
        elif tick == _RUN:
            ahead.stands = RUNS
        else:
            ahead.stands, ahead.tick = LOOKS, tick

    def _ride(self, place: int) -> int:
        """Native code of a robot is to be run."""
        why: int = self._hub.switch(_RUN)
        return why

    def look_at(self, tick: int) -> tuple[Poses, Poses]:
        """Poses at the beginning of a quantum, and a quantum before."""
        if tick > self._world.ticks:
            self._hub.switch(tick)
        return self._poses(tick), self._poses(tick - 1)

    def _poses(self, tick: int) -> Poses:
        """Poses at the beginning of a quantum; the oldest that are kept if they are older."""
        poses = self._past.get(tick)
        if poses is None:
            for stretch in reversed(self._stretches):
                if stretch.first <= tick <= stretch.last:
                    poses = self._past[tick] = self._world.at(stretch, tick)
                    break
            else:
                return self._past[tick + 1]
        return poses

    def moved(self) -> None:
        """Something was put somewhere else between two quanta."""
        self._past[self._world.ticks] = self._world.poses

    def _step_to(self, ticks: int) -> None:
        """Let the world make the quanta that all robots have lived."""
        if ticks > self._world.ticks:
            self._note(self._world.go(self._speeds_at, ROOM, ticks - self._world.ticks))

    def _note(self, made: list[Stretch]) -> None:
        """Quanta have been made."""
        world = self._world
        if made:
            self._stretches += made
            self._past[world.ticks] = world.poses  # whoever looks looks at these
        self._ether.slowest = world.ticks * self._ether.quantum


_RUN: Final = -1
"""What a robot says that is to be run: no tick."""
