"""The peripherals of a chip. `build` constructs all of them on a bus."""

from emu.peripherals.assembly import Peripherals, build, configure_bus
from emu.peripherals.base import IDLE, SLEEP, CpuSignals

__all__ = ["IDLE", "SLEEP", "CpuSignals", "Peripherals", "build", "configure_bus"]
