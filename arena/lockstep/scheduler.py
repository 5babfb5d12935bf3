"""Demand lock-step: each robot runs ahead until it observes the world; the world follows the slowest robot.

A robot whose firmware reads a camera line needs the poses of that quantum. The world can compute them only when all
robots have finished the quanta before. So each robot runs in a greenlet of its own: a robot that needs poses is
suspended in the middle of its run until the others have caught up. A robot sees the same poses as in a run quantum
after quantum, so the record is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import addressof, c_void_p
from functools import partial
from typing import Final, Protocol, runtime_checkable

from greenlet import getcurrent, greenlet

from arena.infrared.channel import OpticalChannel
from arena.lockstep.threads import NEEDS_WORLD, REACHED, NativeScheduler
from arena.robots.native_robot import AWAITS_POSES, IN_PYTHON, RUNNABLE, NativeRobot
from arena.world.physics import World
from arena.world.poses import PoseBlock, Poses
from arena.world.wheels import ROOM, Wheels

_RUN: Final = -1
"""Value that a greenlet passes to the scheduler to have its native code run; every other value is a tick."""


@runtime_checkable
class RunAheadRobot(Protocol):
    """A robot that can run ahead: `arena.robots.firmware_controller.FirmwareController`."""

    @property
    def ticks_done(self) -> int:
        """Quanta the robot has finished."""

    @property
    def wheels(self) -> Wheels:
        """Wheel speeds in the finished quanta."""

    @property
    def native(self) -> NativeRobot:
        """The robot as native code sees it."""

    def run_until(self, ticks: int) -> None:
        """Run until `ticks` quanta are finished."""

    def use_native_runner(self, run_native: Callable[[], int]) -> None:
        """Run native code by `run_native` from now on. It is called in the robot's greenlet and returns the exit
        reason."""

    def use_poses(self, poses_at: Callable[[int], tuple[Poses, Poses]]) -> None:
        """Take poses from `poses_at(tick)` from now on: those at the start of quantum `tick` and of the quantum
        before. At a call the robot must have finished all quanta before `tick`."""


class LockStep:
    """Demand lock-step of `world` and all its `robots`.

    `channel` carries the light between the robots. `threads` threads run native code. With `is_native` false, Python
    runs the native code of each robot and the world, which gives the same record but takes more time.
    """

    def __init__(
        self, world: World, robots: Sequence[RunAheadRobot], channel: OpticalChannel | None = None,
        is_native: bool = True, threads: int = 1,
    ) -> None:  # fmt: skip
        self._world: Final = world
        self._robots: Final = robots
        self._channel: Final = channel or OpticalChannel.of(world.scene)
        self._channel.horizon = 0
        self._known_poses: Final[dict[int, Poses]] = {world.ticks: world.poses}
        self._blocks: list[PoseBlock] = []
        self._is_native: Final = is_native
        self._hub: greenlet = getcurrent()
        self._greenlets: list[greenlet | None] = [None] * len(robots)
        self._is_aborted = False
        self._speeds: Final = (c_void_p * len(robots))(*(robot.wheels.address for robot in robots))
        self._speeds_address: Final = addressof(self._speeds)
        self.scheduler: Final = NativeScheduler(
            [robot.native for robot in robots], self._speeds_address, ROOM, addressof(world.native), threads
        )
        for number, robot in enumerate(robots):
            robot.use_poses(self.poses_at)
            if is_native:
                robot.use_native_runner(partial(self._request_native_run, number))

    def advance(self, ticks: int) -> list[tuple[float, float]]:
        """Run all robots and the world until `ticks` quanta are over; return the wheel speeds in the last of them.

        Raises RuntimeError after a call that ended by an exception: it left robots in the middle of a quantum.
        """
        if self._is_aborted:
            raise RuntimeError("an exception has left robots in the middle of a quantum: begin another trial")
        try:
            while self._world.ticks < ticks:
                self._advance_within_room(min(ticks, self._world.ticks + ROOM))
        except BaseException:
            self._abort()
            raise
        return [robot.wheels.speed(ticks - 1) for robot in self._robots]

    def _abort(self) -> None:
        """End all greenlets. A suspended greenlet would keep its robot, and all others, alive for ever."""
        self._is_aborted = True
        for running in self._greenlets:
            if running is not None:
                running.throw()
        self._greenlets = [None] * len(self._greenlets)

    def _advance_within_room(self, ticks: int) -> None:
        """Advance to `ticks`, at most ROOM quanta ahead."""
        self._hub = getcurrent()
        for number, robot in enumerate(self._robots):
            robot.native.state = IN_PYTHON
            if robot.ticks_done < ticks:
                self._greenlets[number] = greenlet(robot.run_until)
                self._resume(number, ticks)
        while (needed := self._run_native(ticks)) != REACHED:
            if needed == NEEDS_WORLD:
                self._step_world(self.scheduler.world_goal)
            else:
                self._resume(needed, self._robots[needed].native.exit_reason)
        for tick in [tick for tick in self._known_poses if tick < ticks - 1]:
            del self._known_poses[tick]
        self._blocks = [block for block in self._blocks if block.last >= ticks - 1]

    def _run_native(self, ticks: int) -> int:
        """Run robots and world in native code until Python is needed; return the result of `NativeScheduler.run`."""
        world = self._world
        world.prepare_native(self._poses(world.ticks), self._poses(world.ticks - 1), self._is_native)
        needed = self.scheduler.run(ticks)
        self._keep(world.collect_native())
        return needed

    def _resume(self, number: int, answer: int) -> None:
        """Resume the greenlet of a robot with `answer` until it requests a native run, waits for poses or ends."""
        running, native = self._greenlets[number], self._robots[number].native
        assert running is not None
        tick = running.switch(answer)
        if running.dead:
            self._greenlets[number] = None
        elif tick == _RUN:
            native.state = RUNNABLE
        else:
            native.state, native.tick = AWAITS_POSES, tick

    def _request_native_run(self, number: int) -> int:
        """Suspend the robot's greenlet until its native code has run; return the exit reason."""
        exit_reason: int = self._hub.switch(_RUN)
        return exit_reason

    def poses_at(self, tick: int) -> tuple[Poses, Poses]:
        """Return the poses at the start of quantum `tick` and of the quantum before; wait for them if necessary."""
        if tick > self._world.ticks:
            self._hub.switch(tick)
        return self._poses(tick), self._poses(tick - 1)

    def _poses(self, tick: int) -> Poses:
        """Return the poses at the start of quantum `tick`, or the oldest known ones if those are later."""
        poses = self._known_poses.get(tick)
        if poses is None:
            for block in reversed(self._blocks):
                if block.first <= tick <= block.last:
                    poses = self._known_poses[tick] = self._world.poses_in(block, tick)
                    break
            else:
                return self._known_poses[tick + 1]
        return poses

    def refresh_poses(self) -> None:
        """Use the world's new poses after a body was moved between two quanta."""
        self._known_poses[self._world.ticks] = self._world.poses

    def _step_world(self, ticks: int) -> None:
        """Advance the world to a tick that all robots have reached."""
        if ticks > self._world.ticks:
            self._keep(self._world.run_quanta(self._speeds_address, ROOM, ticks - self._world.ticks))

    def _keep(self, made: list[PoseBlock]) -> None:
        """Keep the poses of new quanta and move the channel's horizon."""
        world = self._world
        if made:
            self._blocks += made
            self._known_poses[world.ticks] = world.poses
        self._channel.horizon = world.ticks * self._channel.quantum
