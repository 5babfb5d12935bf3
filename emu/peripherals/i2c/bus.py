"""The I2C bus outside the chip: slaves with addresses, and lines that are held low.

Slaves answer byte by byte. A slave whose state must be part of snapshots keeps it in the record, as board parts do.
"""

from __future__ import annotations

from typing import Final

from emu.peripherals.base import StateCell
from emu.peripherals.pins import Pins, parse_pin
from emu.system.events import Events
from emu.system.record import Record


class I2cDevice:
    """Base class of slaves. The default methods acknowledge every byte and send 0xFF."""

    def start(self, read: bool, cycle: int) -> bool:
        """Handle the slave's address, for reading or writing. Return True to acknowledge it."""
        return True

    def write(self, byte: int, cycle: int) -> bool:
        """Handle a byte that the master wrote. Return True to acknowledge it."""
        return True

    def read(self, cycle: int) -> int:
        """Return the next byte that the master reads."""
        return 0xFF

    def acknowledged(self, more: bool, cycle: int) -> None:
        """Handle the master's ACK (`more` is true) or NACK after a byte that it read."""

    def stop(self, cycle: int) -> None:
        """Handle the end of the transaction, by a Stop or by the Start of another one."""

    def stretch(self, cycle: int) -> int:
        """Return by how many Tcy the slave delays the first clock of the next byte."""
        return 0


class I2cBus:
    """Slaves on the bus, and lines that the environment holds low. Both lines have pull-ups."""

    def __init__(self, pins: Pins, events: Events, record: Record, sda_pin: str, scl_pin: str) -> None:
        self._pins: Final = pins
        self._events: Final = events
        self.port, self.sda = parse_pin(sda_pin)
        scl_port, self.scl = parse_pin(scl_pin)
        if scl_port != self.port:
            raise ValueError("SDA and SCL are expected on one port")
        self.devices: Final[dict[int, I2cDevice]] = {}
        """Slaves by 7-bit address."""
        self._stuck_clocks: Final = StateCell(record, "i2c.stuck_clocks", "I")
        """Number of SCL pulses after which a held SDA is released; 0 if it is not held that way."""
        pins.input[self.port] |= self.sda | self.scl
        pins.watch(scl_pin, self._clocked)

    def attach(self, address: int, device: I2cDevice) -> None:
        """Attach a slave at a 7-bit address (0..127). Raises ValueError if the address is in use or out of range."""
        if not 0 <= address < 128 or address in self.devices:
            raise ValueError(f"I2C address {address:#04x} is in use or out of range")
        self.devices[address] = device

    @property
    def sda_high(self) -> bool:
        """Level of SDA, including the chip's own driver."""
        return bool(self._pins.level[self.port] & self.sda)

    @property
    def scl_high(self) -> bool:
        """Level of SCL, including the chip's own driver."""
        return bool(self._pins.level[self.port] & self.scl)

    def hold(self, *, sda: bool = False, scl: bool = False, clocks: int = 0) -> None:
        """Hold lines low from outside. If `clocks` is not 0, release SDA after that many SCL pulses."""
        self._stuck_clocks.value = clocks if sda else 0
        mask = self.sda | self.scl
        free = (0 if sda else self.sda) | (0 if scl else self.scl)
        self._pins.set_port(self.port, mask, free)

    def release(self) -> None:
        """Release both lines."""
        self.hold()

    def pulses(self, count: int) -> None:
        """Count `count` clock pulses made by the chip's master towards the release of a held SDA."""
        if self._stuck_clocks.value:
            self._stuck_clocks.value = max(self._stuck_clocks.value - count, 0)
            if not self._stuck_clocks.value:
                self.release()

    def _clocked(self, _cycle: int, _changed: int, levels: int) -> None:
        """Count an SCL pulse that software makes through the port, which is how it recovers a held bus."""
        if levels & self.scl:
            self.pulses(1)
