"""An emulated robot's Bluetooth: as a line on the robot's clock, or behind a pseudo terminal."""

from __future__ import annotations

import emu
from emu.machine.machine import Machine

SLICE = 4_000
"""Tcy between looks at the line."""


class Line:
    """A robot's Bluetooth as a line, on the robot's own clock: the same run every time."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.heard = bytearray()
        machine.board.bluetooth.on_byte = lambda byte, _cycle: self.heard.append(byte)

    def write(self, data: bytes) -> None:
        self.machine.board.bluetooth.feed(data)

    def drop(self) -> None:
        self.heard.clear()

    def now(self) -> float:
        return self.machine.cycle / emu.FCY_HZ

    def read(self, seconds: float) -> bytes:
        limit = self.machine.cycle + round(seconds * emu.FCY_HZ) + 1
        while not self.heard and self.machine.cycle < limit:
            self.machine.run(cycles=min(SLICE, limit - self.machine.cycle))
        return bytes([self.heard.pop(0)]) if self.heard else b""
