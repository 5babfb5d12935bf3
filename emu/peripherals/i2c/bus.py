"""The I2C bus outside the chip: slaves with addresses, and lines held low.

Slaves answer byte by byte. A slave whose state must be part of snapshots keeps it in the record, as the boards do.
"""

from __future__ import annotations

from typing import Final

from emu.peripherals.pins import Pins, parse_pin
from emu.system.events import Events


class I2cDevice:
    """Base class of slaves. The defaults acknowledge everything and send 0xFF."""

    def start(self, read: bool, cycle: int) -> bool:
        """Handle being addressed for reading or writing. Return True to acknowledge."""
        return True

    def write(self, byte: int, cycle: int) -> bool:
        """Handle a byte from the master. Return True to acknowledge."""
        return True

    def read(self, cycle: int) -> int:
        """Return the next byte for the master."""
        return 0xFF

    def acknowledged(self, more: bool, cycle: int) -> None:
        """Handle the master's ACK (`more`) or NACK after a byte it read."""

    def stop(self, cycle: int) -> None:
        """Handle the end of the transaction: Stop, or the Start of another one."""

    def stretch(self, cycle: int) -> int:
        """Return the Tcy by which the device delays the first clock of the next byte."""
        return 0


class I2cBus:
    """Slaves on the bus, and lines held low from outside. Both lines have pull-ups."""

    def __init__(self, pins: Pins, events: Events, sda_pin: str, scl_pin: str) -> None:
        self._pins: Final = pins
        self._events: Final = events
        self.port, self.sda = parse_pin(sda_pin)
        scl_port, self.scl = parse_pin(scl_pin)
        if scl_port != self.port:
            raise ValueError("SDA and SCL are expected on one port")
        self.devices: Final[dict[int, I2cDevice]] = {}
        """Slaves by 7-bit address."""
        self._stuck_clocks = 0
        pins.input[self.port] |= self.sda | self.scl
        pins.watch(scl_pin, self._clocked)

    def attach(self, address: int, device: I2cDevice) -> None:
        """Attach a slave at a 7-bit address (0..127). Raises ValueError if the address is in use or out of range."""
        if not 0 <= address < 128 or address in self.devices:
            raise ValueError(f"I2C address {address:#04x} is in use or out of range")
        self.devices[address] = device

    @property
    def sda_high(self) -> bool:
        """Level of SDA, the chip's own driver included."""
        return bool(self._pins.level[self.port] & self.sda)

    @property
    def scl_high(self) -> bool:
        """Level of SCL, the chip's own driver included."""
        return bool(self._pins.level[self.port] & self.scl)

    def hold(self, *, sda: bool = False, scl: bool = False, clocks: int = 0) -> None:
        """Hold lines low from outside; with `clocks`, release SDA after that many SCL pulses."""
        self._stuck_clocks = clocks if sda else 0
        mask = self.sda | self.scl
        free = (0 if sda else self.sda) | (0 if scl else self.scl)
        self._pins.set_port(self.port, mask, free)

    def release(self) -> None:
        """Release both lines."""
        self.hold()

    def pulses(self, count: int) -> None:
        """Count `count` clock pulses of the chip's master towards the release of a held SDA."""
        if self._stuck_clocks:
            self._stuck_clocks = max(self._stuck_clocks - count, 0)
            if not self._stuck_clocks:
                self.release()

    def _clocked(self, _cycle: int, _changed: int, levels: int) -> None:
        """Count an SCL pulse made through the port: software recovers a held bus this way."""
        if levels & self.scl:
            self.pulses(1)
