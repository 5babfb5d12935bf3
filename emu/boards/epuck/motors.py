"""The two stepper motors (epuck.md §3): phases to steps, lost and illegal sequences, coil time.

Software writes the four phase bits one after the other, so intermediate nibbles appear for a few cycles: a nibble
counts once it has stood for `SETTLE` Tcy. Nothing is posted for that; what is due is settled when somebody looks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.boards.part import Part
from emu.peripherals import Peripherals

PORT: Final = 3
"""Port D: left motor on bits 3:0, right motor on bits 7:4 (epuck.md §2)."""
PHASES: Final = {0xA: 0, 0x6: 1, 0x5: 2, 0x9: 3}
"""Port nibble to index of the phase table (epuck.md §3); 0 is off, everything else is no valid pattern."""
SETTLE: Final = 15
"""Tcy a pattern must stand to count: about 1 us (epuck.md §3)."""
STEPS_PER_TURN: Final = 1000
"""Motor steps per turn of the wheel: 20 steps, gear 50:1 (epuck.md §3)."""
MM_PER_STEP: Final = 0.128
"""Travel of the wheel's rim per step in mm (epuck.md §3)."""

_NOWHERE: Final = 4


class Stepper(Part):
    """One motor. `steps` counts full steps, forward positive."""

    def __init__(self, name: str, chip: Peripherals, shift: int, forward: int) -> None:
        super().__init__(name, chip)
        self._shift: Final = shift
        self._forward: Final = forward
        self._steps: Final = self.cell("steps", "q")
        self._lost: Final = self.cell("lost")
        self._illegal: Final = self.cell("illegal")
        self._index: Final = self.cell("index", "B", _NOWHERE)
        self._nibble: Final = self.cell("nibble", "B")
        self._since: Final = self.cell("since", "Q")
        self._settled: Final = self.cell("settled", "B", 1)
        self._on_time: Final = self.cell("on_time", "Q")
        self._on_step: Callable[[int, int], None] | None = None
        self.pins.watch_port(PORT, 0xF << shift, self._changed, lazy=True)

    @property
    def steps(self) -> int:
        """Steps made so far; negative = backward."""
        self._catch_up()
        return self._steps.value

    @property
    def lost(self) -> int:
        """Jumps by two phases: the rotor does not follow."""
        self._catch_up()
        return self._lost.value

    @property
    def illegal(self) -> int:
        """Patterns that are no phase and stood for 1 us or more."""
        self._catch_up()
        return self._illegal.value

    @property
    def coil_cycles(self) -> int:
        """Tcy during which at least one coil was on: what the battery pays for."""
        self._catch_up()
        running = max(self.now - self._since.value, 0) if self._nibble.value else 0
        return self._on_time.value + running

    def listen(self, on_step: Callable[[int, int], None]) -> None:
        """Call on_step(cycle, direction) at each step, when the next pattern shows that it was one; `cycle` is when
        the step's pattern appeared."""
        self._on_step = on_step
        self.pins.watch_port(PORT, 0xF << self._shift, lambda *_edge: None)  # so that edges come by as they happen

    def _catch_up(self) -> None:
        self.pins.flush()
        self._settle(self.now)

    def _changed(self, cycle: int, _changed: int, levels: int) -> None:
        nibble = levels >> self._shift & 0xF
        self._settle(cycle)
        if self._nibble.value:
            self._on_time.value += cycle - self._since.value
        self._nibble.value = nibble
        self._since.value = cycle
        self._settled.value = 0

    def _settle(self, cycle: int) -> None:
        """Count the present pattern if it has stood long enough by `cycle`."""
        if self._settled.value or cycle - self._since.value < SETTLE:
            return
        self._settled.value = 1
        nibble = self._nibble.value
        if nibble == 0:
            return  # all off: friction in the gear keeps the rotor where it is
        index = PHASES.get(nibble)
        if index is None:
            self._illegal.value += 1
            return
        before = self._index.value
        self._index.value = index
        moved = (index - before) % 4 if before != _NOWHERE else 0
        if moved == 2:
            self._lost.value += 1
        elif moved:
            direction = self._forward if moved == 1 else -self._forward
            self._steps.value += direction
            if self._on_step is not None:
                self._on_step(self._since.value, direction)


class Motors:
    """Left and right (forward: left index falls, right index rises; epuck.md §3)."""

    def __init__(self, chip: Peripherals) -> None:
        self.left: Final = Stepper("motor.left", chip, 0, -1)
        self.right: Final = Stepper("motor.right", chip, 4, 1)
