"""A debugged Kilobot within its crowd: the present runs with all robots, the past alone with the inputs of a log.

Inputs are the voltages that light causes. In the present the swarm logs each of them, with the cycle at which the
microcontroller was given it. A replay gives it the same inputs at the same cycles, so it reaches the same states.
"""

from __future__ import annotations

import struct
from ctypes import addressof, string_at
from typing import Final

from arena.robots.kilobot import KilobotCrowd
from emu.avr.core.state import NEVER
from emu.avr.machine import HALT, Atmega328p, Change
from emu.avr.native import native
from emu.avr.observation import STOP_INPUTS, STOP_NONE, Observation
from emu.boards.kilobot.swarm import KilobotFaultError

_INPUT: Final = struct.Struct("=QQII")
"""A logged input: given, at, kind, value (`LoggedInput`)."""
_HEAD: Final = struct.Struct("<Q")
"""Head of a snapshot: the number of logged inputs that the microcontroller has been given."""


class CrowdMember:
    """Robot number `index` of `crowd`; the `Surroundings` of its `DebuggedKilobot`.

    `is_past` selects what `run_until` runs: the robot alone, or the crowd, at most to the tick `end`. The log takes 24
    bytes for each change of the light that the robot sees.
    """

    def __init__(self, crowd: KilobotCrowd, index: int) -> None:
        self._crowd: Final = crowd
        self._index: Final = index
        self.machine: Final[Atmega328p] = crowd.swarm.robots[index]
        self.has_ended: Final = False
        """Light can wake the CPU at any time."""
        self.is_past = False
        self.end = 0
        """Tick (125 ns) at which the crowd waits for the world."""
        self.is_at_end = False
        """Whether all robots have reached this tick."""
        self._log: Final = bytearray()
        self._given = 0
        """Number of logged inputs that the microcontroller has been given."""
        self._changes: list[Change] = []
        self._run: Final = native()["avr_run_observed"]

    def observe(self, observation: Observation) -> None:
        """As `Surroundings.observe`; its inputs are logged."""
        self._observation = observation
        observation.logging = 1
        self._crowd.swarm.observe(self._index, observation)

    def release(self) -> None:
        """Let the robot run as all others from now on."""
        self._crowd.breakpoints.debug(self._index, None)

    def run_until(self, cycle: int) -> None:
        """As `Surroundings.run_until`. In the present, the robot does not run past the tick `end`."""
        if self.is_past:
            self._replay(cycle)
        else:
            self._run_crowd(cycle)
        if self.is_past or not self.is_at_end:  # at the end, the world may give inputs before the events of this cycle
            self.machine.apply_due()

    def _run_crowd(self, cycle: int) -> None:
        """Run the crowd until the robot reaches a cycle, its next stop, or the tick `end`."""
        seen, crowd = self._observation, self._crowd
        seen.last = cycle
        first = len(self.machine.changes)
        try:
            while True:
                try:
                    crowd.breakpoints.run_until(self.end)
                except KilobotFaultError as fault:
                    if fault.robot == self._index:
                        raise
                    crowd.switch_off(fault)
                    continue
                finally:
                    self._take_inputs()
                if seen.reason != STOP_INPUTS:
                    break
                seen.reason = STOP_NONE
            self.is_at_end = crowd.swarm.has_reached(self._index, self.end)
        finally:
            seen.last = NEVER
            self._changes = self.machine.changes[first:]

    def _take_inputs(self) -> None:
        """Append the inputs of the last run to the log."""
        seen = self._observation
        self._log.extend(string_at(addressof(seen.inputs), seen.input_count * _INPUT.size))
        self._given += seen.input_count
        seen.input_count = 0

    def take_changes(self) -> list[Change]:
        """As `Surroundings.take_changes`; the controller gets those of the present, too."""
        changes, self._changes = self._changes, []
        return changes

    def _replay(self, cycle: int) -> None:
        """Run the robot alone to a cycle or its next stop."""
        machine, seen, state = self.machine, self._observation, self.machine.state
        kept = len(machine.changes)
        while True:
            due = self._give_inputs()
            if state.cycle >= cycle or seen.reason != STOP_NONE:
                return
            goal = min(cycle, due)
            result = self._run(addressof(state), machine.program.address, goal, addressof(seen))
            if result == HALT:
                state.cycle = max(state.cycle, goal)
            state.light_changed = 0
            fault = machine.attend()
            del machine.changes[kept:]
            if fault is not None:
                raise KilobotFaultError(self._index, fault.message)

    def _give_inputs(self) -> int:
        """Give the microcontroller the inputs that it had been given by now. Return the cycle of the next ones."""
        while self._given * _INPUT.size < len(self._log):
            given, at, kind, value = _INPUT.unpack_from(self._log, self._given * _INPUT.size)
            if given > self.machine.cycle:
                return int(given)
            self.machine.give_input(at, kind, value)
            self._given += 1
        return NEVER

    def snapshot(self) -> bytes:
        """As `Surroundings.snapshot`."""
        return _HEAD.pack(self._given) + self.machine.snapshot()

    def restore(self, snapshot: bytes) -> None:
        """As `Surroundings.restore`."""
        self.machine.restore(snapshot[_HEAD.size :])
        (self._given,) = _HEAD.unpack_from(snapshot)
