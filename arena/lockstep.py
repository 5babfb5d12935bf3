"""Demand lock-step: robots run ahead until they look at something, the world follows the slowest of them.

A robot whose firmware reads a line of its camera needs poses of that quantum; the world can only tell them when all
robots have lived until then. So each robot is a greenlet: one that looks is left where it stands, in the middle of its
run, until the others have come as far. Nothing that is recorded can tell this from quantum after quantum: a robot sees
the same poses either way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import addressof, c_void_p
from typing import Final, Protocol, runtime_checkable

from greenlet import getcurrent, greenlet

from arena.ether import Ether
from arena.wheels import ROOM, Wheels
from arena.world import Poses, Stretch, World


@runtime_checkable
class Runner(Protocol):
    """A robot that can run ahead: `arena.emulated.EmulatedBrain`."""

    lived: int
    """Quanta that are over for it."""

    def live(self, ticks: int) -> None:
        """Live until so many quanta are over."""

    wheels: Wheels
    """How fast they turned in quanta that are over."""

    def join(self, look_at: Callable[[int], tuple[Poses, Poses]]) -> None:
        """Get poses from `look_at` from now on: those at the beginning of a quantum, and a quantum before. All quanta
        before it must be over for the robot when it asks."""


class LockStep:
    """`world`, the robots that are in it, all of them, and what carries their infrared light."""

    def __init__(self, world: World, robots: Sequence[Runner], ether: Ether | None = None) -> None:
        self._world: Final = world
        self._robots: Final = robots
        self._ether: Final = ether or Ether.of(world.scene)
        self._ether.slowest = 0
        self._past: Final[dict[int, Poses]] = {world.ticks: world.poses}
        self._stretches: list[Stretch] = []
        self._hub: greenlet = getcurrent()
        self._speeds: Final = (c_void_p * len(robots))(*(robot.wheels.address for robot in robots))
        self._speeds_at: Final = addressof(self._speeds)
        for robot in robots:
            robot.join(self.look_at)

    def advance(self, ticks: int) -> list[tuple[float, float]]:
        """Let so many quanta be over for everybody; wheel speeds of the last of them."""
        while ticks - self._world.ticks > ROOM:
            self.advance(self._world.ticks + ROOM)
        self._hub = getcurrent()
        waiting = {greenlet(robot.live): self._world.ticks for robot in self._robots if robot.lived < ticks}
        asked: tuple[int, ...] = (ticks,)  # the first time a greenlet is switched to it gets the argument of `live`
        ready = list(waiting)
        while ready:
            for life in ready:
                looks_at = life.switch(*asked)
                if life.dead:
                    del waiting[life]
                else:
                    waiting[life] = looks_at
            asked = ()
            until = min(waiting.values(), default=ticks)
            self._step_to(until)
            ready = [life for life, tick in waiting.items() if tick == until]
        for tick in [tick for tick in self._past if tick < ticks - 1]:
            del self._past[tick]
        self._stretches = [stretch for stretch in self._stretches if stretch.last >= ticks - 1]
        return [robot.wheels.speed(ticks - 1) for robot in self._robots]

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
        world = self._world
        if ticks > world.ticks:
            self._stretches += world.go(self._speeds_at, ROOM, ticks - world.ticks)
            self._past[ticks] = world.poses  # whoever looks looks at these
        self._ether.slowest = world.ticks * self._ether.quantum
