"""Bluetooth connections of an emulated robot: one on the robot's clock, one through a pseudo terminal."""

from __future__ import annotations

import emu
from emu.machine.machine import Machine

SLICE = 4_000
"""Tcy between two polls of the line."""
LONGEST = 8 * SLICE
"""Tcy between two polls of a line that has been silent for some time."""


class Line:
    """A robot's Bluetooth connection on the robot's clock, which makes runs reproducible."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.heard = bytearray()
        machine.board.bluetooth.on_byte = lambda byte, _cycle: self.heard.append(byte)

    def write(self, data: bytes) -> None:
        self.machine.board.bluetooth.feed(data)

    def discard_received(self) -> None:
        self.heard.clear()

    def now(self) -> float:
        return self.machine.cycle / emu.FCY_HZ

    def read(self, seconds: float) -> bytes:
        limit = self.machine.cycle + round(seconds * emu.FCY_HZ) + 1
        cycles = SLICE
        while not self.heard and self.machine.cycle < limit:
            self.machine.run(cycles=min(cycles, limit - self.machine.cycle))
            cycles = min(2 * cycles, LONGEST)
        return bytes([self.heard.pop(0)]) if self.heard else b""
