"""The peripherals of a chip. `build` puts all of them on a bus."""

from emu.peripherals.assembly import Peripherals, build, wire_bus
from emu.peripherals.base import IDLE, SLEEP, Wires

__all__ = ["IDLE", "SLEEP", "Peripherals", "Wires", "build", "wire_bus"]
