"""The request lines to a chip's interrupt controller (§5).

Devices set the flags, which are otherwise plain storage. The CPU handles priorities and the controller's other
registers. A request made by a register write becomes visible one cycle later (see `emu.system.device.Irq`).
"""

from __future__ import annotations

from typing import Final

from emu.peripherals.base import ChipContext
from emu.system.device import Irq


class Interrupts:
    """Request lines, one for each implemented interrupt source."""

    def __init__(self, context: ChipContext) -> None:
        sfrs = context.chip.sfrs
        self._lines: Final = {
            number: Irq(context.bus.record, context.bus.events, sfrs[source.flag[0]].address, source.flag[1])
            for number, source in context.chip.interrupts.items()
        }

    def line(self, number: int) -> Irq:
        """Return the request line of interrupt `number` (natural order). Raises KeyError for a reserved number."""
        return self._lines[number]
