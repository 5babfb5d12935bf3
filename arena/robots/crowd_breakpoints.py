"""Breakpoints of Kilobots: hooks before an instruction, of robots that run as all others or under a debugger.

A robot with breakpoints runs instruction by instruction (emu/avr/core/observed.c), with the same result. While a
debugger has the robot, the debugger's machine calls the hooks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from emu.avr.observation import STOP_NONE, STOP_PLACE, Observation
from emu.boards.kilobot.swarm import KilobotSwarm

Hook = Callable[[], object]


class HookedMachine(Protocol):
    """A machine that calls hooks (`DebuggedKilobot`)."""

    def hook_pc(self, place: int, hook: Hook) -> Callable[[], None]:
        """Call `hook` before the instruction at a byte address. Return a function that removes it."""


class _Breakpoint:
    """A hook at a byte address. `deactivate` takes it from the machine that calls it."""

    def __init__(self, address: int, hook: Hook) -> None:
        self.address: Final = address
        self.hook: Final = hook
        self.deactivate: Callable[[], None] = lambda: None


class CrowdBreakpoints:
    """Breakpoints of the robots of `swarm`, by their index."""

    def __init__(self, swarm: KilobotSwarm) -> None:
        self._swarm: Final = swarm
        self._breakpoints: Final[dict[int, list[_Breakpoint]]] = {}
        self._observations: Final[dict[int, Observation]] = {}
        self._debugged: Final[dict[int, HookedMachine]] = {}

    def add(self, robot: int, place: str, hook: Hook) -> Callable[[], None]:
        """Call `hook` before a robot executes the first instruction of a function. Return a function that removes it.

        Raises KeyError for an unknown function.
        """
        symbol = self._swarm.robots[robot].image.symbols.find(place)
        if symbol is None or symbol.space != "code":
            raise KeyError(f"the image has no function {place!r}")
        one = _Breakpoint(symbol.address, hook)
        self._breakpoints.setdefault(robot, []).append(one)
        self._activate(robot, one)

        def remove() -> None:
            self._breakpoints[robot].remove(one)
            one.deactivate()

        return remove

    def debug(self, robot: int, machine: HookedMachine | None) -> None:
        """Let a debugger's machine call the hooks of a robot from now on; None: the debugger has released the robot."""
        active = self._breakpoints.get(robot, [])
        if machine is not None:
            self._debugged[robot] = machine
        for one in active:
            one.deactivate()
        if machine is None:
            self._debugged.pop(robot, None)
            self._swarm.observe(robot, None)
        for one in active:
            self._activate(robot, one)

    def run_until(self, tick: int) -> None:
        """Run the swarm to a tick, or until a debugged robot stops; call the hooks of the others at their stops.

        Raises KilobotFaultError.
        """
        while True:
            self._swarm.run_until(tick)
            stopped = [robot for robot, one in self._observations.items() if one.reason == STOP_PLACE]
            if not stopped:
                return
            for robot in stopped:
                self._observations[robot].reason = STOP_NONE
                pc = self._swarm.robots[robot].pc
                for hook in [one.hook for one in self._breakpoints[robot] if one.address == pc]:
                    hook()

    def _activate(self, robot: int, one: _Breakpoint) -> None:
        if robot in self._debugged:
            one.deactivate = self._debugged[robot].hook_pc(one.address, one.hook)
            return
        observation = self._observations.setdefault(robot, Observation())
        observation.places[one.address >> 1] += 1
        self._swarm.observe(robot, observation)

        def deactivate() -> None:
            observation.places[one.address >> 1] -= 1
            if robot not in self._debugged and not any(observation.places):
                self._swarm.observe(robot, None)

        one.deactivate = deactivate
