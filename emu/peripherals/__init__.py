"""The peripherals of a chip. `build` puts all of them on a bus."""

from emu.peripherals.kit import IDLE, SLEEP, Wires
from emu.peripherals.peripherals import Peripherals, build, wire_bus

__all__ = ["IDLE", "SLEEP", "Peripherals", "Wires", "build", "wire_bus"]
