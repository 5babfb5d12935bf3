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
"""Index before the first pattern."""
_ILLEGAL: Final = -1

_MEANING: Final = tuple(_NOWHERE if nibble == 0 else PHASES.get(nibble, _ILLEGAL) for nibble in range(16))
"""Phase index of a nibble; _NOWHERE for all coils off, _ILLEGAL for what is no phase."""

_STEPS, _LOST, _ILLEGALS, _INDEX, _NIBBLE, _SINCE, _SETTLED, _ON_TIME = range(8)
"""Places in `motor.<side>.state`."""


class Stepper(Part):
    """One motor. `steps` counts full steps, forward positive.

    State is one run of signed 64-bit numbers in the record, because edges come by the thousand per second.
    """

    def __init__(self, name: str, chip: Peripherals, shift: int, forward: int) -> None:
        super().__init__(name, chip)
        self._shift: Final = shift
        self._forward: Final = forward
        first = self.record.reserve(f"{name}.state", "q", 8).index
        self._state: Final = self.record.s64[first : first + 8]
        self._state[_INDEX] = _NOWHERE
        self._state[_SETTLED] = 1
        self._on_step: Callable[[int, int], None] | None = None
        self.pins.watch_port(PORT, 0xF << shift, self._changed, lazy=True)

    @property
    def steps(self) -> int:
        """Steps made so far; negative = backward."""
        self._catch_up()
        return self._state[_STEPS]

    @property
    def lost(self) -> int:
        """Jumps by two phases: the rotor does not follow."""
        self._catch_up()
        return self._state[_LOST]

    @property
    def illegal(self) -> int:
        """Patterns that are no phase and stood for 1 us or more."""
        self._catch_up()
        return self._state[_ILLEGALS]

    @property
    def coil_cycles(self) -> int:
        """Tcy during which at least one coil was on: what the battery pays for."""
        self._catch_up()
        state = self._state
        running = max(self.now - state[_SINCE], 0) if state[_NIBBLE] else 0
        return state[_ON_TIME] + running

    def counts(self) -> tuple[int, int, int, int]:
        """`steps`, `lost`, `illegal` and `coil_cycles` in one call."""
        coil_cycles = self.coil_cycles
        state = self._state
        return state[_STEPS], state[_LOST], state[_ILLEGALS], coil_cycles

    def listen(self, on_step: Callable[[int, int], None]) -> None:
        """Call on_step(cycle, direction) at each step, when the next pattern shows that it was one; `cycle` is when
        the step's pattern appeared."""
        self._on_step = on_step
        self.pins.watch_port(PORT, 0xF << self._shift, lambda *_edge: None)  # so that edges come by as they happen

    def _catch_up(self) -> None:
        self.pins.flush()
        self.settled_steps(self.now)

    def settled_steps(self, now: int) -> int:
        """Steps up to cycle `now`, once the pins have told all edges."""
        state = self._state
        if not state[_SETTLED] and now - state[_SINCE] >= SETTLE:
            self._settle()
        return state[_STEPS]

    def _changed(self, cycle: int, _changed: int, levels: int) -> None:
        """A new pattern: what the last one was is known now."""
        state = self._state
        stood = cycle - state[_SINCE]
        if stood >= SETTLE and not state[_SETTLED]:
            self._settle()
        if state[_NIBBLE]:
            state[_ON_TIME] += stood
        state[_NIBBLE] = levels >> self._shift & 0xF
        state[_SINCE] = cycle
        state[_SETTLED] = 0

    def _settle(self) -> None:
        """The present pattern has stood long enough to count."""
        state = self._state
        state[_SETTLED] = 1
        index = _MEANING[state[_NIBBLE]]
        if index == _NOWHERE:
            return  # all off: friction in the gear keeps the rotor where it is
        if index == _ILLEGAL:
            state[_ILLEGALS] += 1
            return
        before = state[_INDEX]
        state[_INDEX] = index
        moved = (index - before) & 3 if before != _NOWHERE else 0
        if moved == 2:
            state[_LOST] += 1
        elif moved:
            direction = self._forward if moved == 1 else -self._forward
            state[_STEPS] += direction
            if self._on_step is not None and not self.events.quiet:
                self._on_step(state[_SINCE], direction)


class Motors:
    """Left and right (forward: left index falls, right index rises; epuck.md §3)."""

    def __init__(self, chip: Peripherals) -> None:
        self.left: Final = Stepper("motor.left", chip, 0, -1)
        self.right: Final = Stepper("motor.right", chip, 4, 1)

    def steps(self) -> tuple[int, int]:
        """Steps of both made so far (left, right): what `Stepper.steps` of each says, in one look."""
        left = self.left
        left.pins.flush()
        now = left.events.now
        return left.settled_steps(now), self.right.settled_steps(now)
