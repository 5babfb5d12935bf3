"""Base class of a board's parts: state in the record, event slots, and the chip's pins.

Parts are outside the chip. They keep running when the chip sleeps and keep their state when it is reset.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.peripherals import Peripherals
from emu.peripherals.base import StateCell
from emu.peripherals.pins import Pins
from emu.system.events import Events
from emu.system.record import Record


class BoardPart:
    """Base class of a board's parts."""

    def __init__(self, name: str, chip: Peripherals) -> None:
        self.name: Final = name
        self.chip: Final = chip
        self.record: Final[Record] = chip.context.bus.record
        self.events: Final[Events] = chip.context.bus.events
        self.pins: Final[Pins] = chip.pins

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of a {self.chip.context.chip.name}>"

    @property
    def now(self) -> int:
        """Cycle (Tcy) of the access or event that is being handled."""
        return self.events.now

    def cell(self, purpose: str, kind: str = "I", initial: int = 0) -> StateCell:
        """Reserve a scalar of state, named `<part>.<purpose>` in the record."""
        return StateCell(self.record, f"{self.name}.{purpose}", kind, initial)

    def array(self, purpose: str, kind: str, count: int) -> memoryview[int]:
        """Reserve `count` elements of state ("B", "H", "I" or "Q"), named `<part>.<purpose>` in the record."""
        return self.record.reserve_array(f"{self.name}.{purpose}", kind, count)

    def slot(self, purpose: str, fire: Callable[[int], None]) -> int:
        """Reserve an event slot that calls `fire`."""
        return self.events.slot(f"{self.name}.{purpose}", fire)

    def cycles(self, seconds: float) -> int:
        """Return the number of Tcy in `seconds` at the current clock."""
        return round(seconds * self.chip.fcy)
