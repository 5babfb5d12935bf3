"""The peripherals of a chip. `build` constructs all of them on a bus."""

from emu.peripherals.base import IDLE, SLEEP, CpuSignals
from emu.peripherals.peripherals import Peripherals, build, configure_bus

__all__ = ["IDLE", "SLEEP", "CpuSignals", "Peripherals", "build", "configure_bus"]
