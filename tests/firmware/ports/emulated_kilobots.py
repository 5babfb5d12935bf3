"""Kilobots of the project's own AVR emulator with the interface of `firmware.tools.simulated.kilobots`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from emu.avr.image import load_avr_image
from emu.avr.machine import UDR0, Atmega328p
from emu.boards.kilobot.swarm import KilobotSetup, KilobotSwarm
from firmware.tools.simulated.kilobots import Robot
from firmware.tools.simulated.machine import Symbols

DATA_MASK = 0xFFFF


class EmulatedKilobot:
    """A robot, alone or in a swarm."""

    pointer = 2

    def __init__(self, machine: Atmega328p, image: Path) -> None:
        self.machine = machine
        self.symbols = Symbols(image)
        machine.watch([UDR0])
        self._watched = range(0)

    @property
    def pc(self) -> int:
        return self.machine.pc

    @property
    def now(self) -> int:
        return self.machine.cycle

    def peek_bytes(self, address: int, count: int) -> bytes:
        return self.machine.peek_bytes(address & DATA_MASK, count)

    def poke_bytes(self, address: int, data: bytes) -> None:
        self.machine.poke_bytes(address & DATA_MASK, data)

    def uart(self) -> bytes:
        """Return the UART's output since the last call."""
        sent = bytes(change.value for change in self.machine.changes if change.register == UDR0)
        self.machine.changes.clear()
        return sent

    def watch_stack(self, lowest: int, highest: int) -> None:
        """Select the stack that `lowest_sp` examines, by its addresses. The kernel has filled it with one value."""
        self._watched = range(lowest, highest + 1)

    def lowest_sp(self) -> int:
        """Return the stack pointer that belongs to the lowest byte that no longer has that value."""
        content = self.peek_bytes(self._watched.start, len(self._watched))
        return self._watched.start + next(n for n, byte in enumerate(content) if byte != content[0]) - 1


class EmulatedKilobots:
    """A swarm. Arguments and methods are those of `Kilobots`."""

    def __init__(self, robots: Sequence[Robot], *, seed: int = 1, loss: float = 0.0) -> None:
        images = {robot.image: load_avr_image(str(robot.image)) for robot in robots}
        self._swarm = KilobotSwarm(
            [KilobotSetup(images[robot.image], robot.x, robot.y, robot.number, robot.on_at, robot.calibrated)
             for robot in robots], seed=seed, loss=loss, delay=18)  # fmt: skip
        self.robots = [EmulatedKilobot(machine, robot.image)
                       for machine, robot in zip(self._swarm.robots, robots, strict=True)]  # fmt: skip
        self.move, self.run = self._swarm.move, self._swarm.run
        self.flash = self._swarm.flash

    @property
    def now(self) -> int:
        return self._swarm.now

    def close(self) -> None:
        """End the swarm."""
        self._swarm.close()
