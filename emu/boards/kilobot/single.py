"""One Kilobot under an overhead controller, for `emu run`, `emu profile` and `emu debug`."""

from __future__ import annotations

import struct
from typing import Final

from emu.avr.core.state import NEVER
from emu.avr.image import AvrImage
from emu.avr.machine import HZ, Atmega328p, Change
from emu.avr.observation import Observation
from emu.boards.kilobot.messages import DATA_SIZE, TYPES, Message, frame
from emu.boards.kilobot.overhead import send_frame
from emu.boards.kilobot.swarm import LEAD_TICKS, KilobotSetup, KilobotSwarm

FIRST_COMMAND: Final = HZ // 5
"""Tick of the overhead controller's first message."""
COMMAND_TICKS: Final = HZ // 2
"""Ticks for which it repeats the message. IDLE looks at the robot's state every 201 ms (kilobot.md §2)."""


class SingleKilobot:
    """A robot at power-on. `uid`: 0 to 65535. `command`: what the controller repeats, "none" or a key of TYPES.

    Its cycles are the ticks of the swarm, because its clock is exact.
    """

    def __init__(self, image: AvrImage, *, uid: int = 0, command: str = "run") -> None:
        self.swarm: Final = KilobotSwarm([KilobotSetup(image, number=uid)])
        self.machine: Final[Atmega328p] = self.swarm.robots[0]
        self.next_command: int | None = None if command == "none" else FIRST_COMMAND
        """Tick of the controller's next message; None after the last one."""
        self._frame: Final = b"" if command == "none" else frame(Message(bytes(DATA_SIZE), TYPES[command]))

    @property
    def has_ended(self) -> bool:
        """Whether nothing can wake the CPU any more."""
        return bool(self.machine.state.halted) and self.next_command is None

    def observe(self, observation: Observation) -> None:
        """Run the robot instruction by instruction from now on."""
        self.swarm.observe(0, observation)

    def take_changes(self) -> list[Change]:
        """Return the changes of watched registers since the last call."""
        changes = self.machine.changes[:]
        self.machine.changes.clear()
        return changes

    def run_until(self, tick: int) -> None:
        """Run to `tick` (125 ns each), or until the observed robot stops. Raises KilobotFaultError."""
        swarm = self.swarm
        while swarm.now < tick:
            announced = None if self.next_command is None else self.next_command - LEAD_TICKS
            swarm.run_until(tick if announced is None else min(tick, announced))
            if self.next_command is not None and swarm.now == announced:
                after = send_frame(swarm, self._frame, self.next_command)
                self.next_command = after if after < FIRST_COMMAND + COMMAND_TICKS else None
            if swarm.is_stopped:
                break
        self.machine.apply_due()

    def snapshot(self) -> bytes:
        """Return the whole state of robot, light and controller."""
        return struct.pack("<Q", NEVER if self.next_command is None else self.next_command) + self.swarm.snapshot()

    def restore(self, snapshot: bytes) -> None:
        """Return to the state of a snapshot of this object. Raises ValueError for other bytes."""
        self.swarm.restore(snapshot[8:])
        (command,) = struct.unpack_from("<Q", snapshot)
        self.next_command = None if command == NEVER else command
