"""The two wires outside the chip: slaves with addresses, stuck lines, and an outside master.

Slaves answer byte by byte. Their own state is the outside's affair: a device that must survive snapshots keeps it in
the record, as the boards do.
"""

from __future__ import annotations

from typing import Final

from emu.peripherals.pins import Pins, parse_pin
from emu.system.events import Events


class I2cDevice:
    """A slave. The defaults are those of a device that acknowledges everything and sends 0xFF."""

    def start(self, read: bool, cycle: int) -> bool:
        """The device is addressed for reading or writing. True acknowledges."""
        return True

    def write(self, byte: int, cycle: int) -> bool:
        """The master sent a byte. True acknowledges."""
        return True

    def read(self, cycle: int) -> int:
        """The next byte for the master."""
        return 0xFF

    def acknowledged(self, more: bool, cycle: int) -> None:
        """The master acknowledged a byte that was read (`more`), or not."""

    def stop(self, cycle: int) -> None:
        """The transaction ended with Stop or with the Start of another."""

    def stretch(self, cycle: int) -> int:
        """Tcy by which the device delays the first clock of the coming byte."""
        return 0


class I2cBus:
    """Who is on the bus, and which lines something holds low. Both lines have pull-ups."""

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
        """Put a slave at a 7-bit address (0..127). Raises ValueError if it is taken."""
        if not 0 <= address < 128 or address in self.devices:
            raise ValueError(f"I2C address {address:#04x} is taken or out of range")
        self.devices[address] = device

    @property
    def sda_high(self) -> bool:
        """Level of SDA with the chip's own driver."""
        return bool(self._pins.level[self.port] & self.sda)

    @property
    def scl_high(self) -> bool:
        """Level of SCL with the chip's own driver."""
        return bool(self._pins.level[self.port] & self.scl)

    def hold(self, *, sda: bool = False, scl: bool = False, clocks: int = 0) -> None:
        """Something holds lines low from now on; with `clocks`, SDA is let go after that many SCL pulses."""
        self._stuck_clocks = clocks if sda else 0
        mask = self.sda | self.scl
        free = (0 if sda else self.sda) | (0 if scl else self.scl)
        self._pins.set_port(self.port, mask, free)

    def release(self) -> None:
        """Both lines are free again."""
        self.hold()

    def pulses(self, count: int) -> None:
        """The chip's master has given `count` clock pulses: a slave stuck in the middle of a byte moves on."""
        if self._stuck_clocks:
            self._stuck_clocks = max(self._stuck_clocks - count, 0)
            if not self._stuck_clocks:
                self.release()

    def _clocked(self, _cycle: int, _changed: int, levels: int) -> None:
        """SCL moved as a port pin: software recovers a stuck bus by hand."""
        if levels & self.scl:
            self.pulses(1)
