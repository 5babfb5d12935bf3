"""Exposure of the camera: lamp brightness, manual exposure, automatic exposure control (epuck.md §7.6).

A scene's pixel values hold at brightness 1. Automatic control approaches the exposure that compensates the lamp: each
frame reduces the difference by a constant factor. Its state is an exposure value and the cycle at which it was valid.
"""

from __future__ import annotations

import math
from typing import Final

from emu.peripherals.base import StateCell
from emu.system.record import Record

FRAMES: Final = 2.0  # UNVERIFIED: 99 % after ten frames; §7.6 says 5 to 10 frames to converge
SHORTEST, LONGEST = 1 / 128, 8.0  # UNVERIFIED range of exposure and gain together
ONE: Final = 1 << 16
"""Fixed-point representation of a brightness or exposure of 1."""
_SETTLED: Final = 1 / 256
"""Relative difference below which automatic exposure counts as settled; it is invisible in 8 bits."""


class Exposure:
    """Exposure state, in the cells `camera.lamp`, `camera.exposure` (in 1/`ONE`) and `camera.exposed_at`."""

    def __init__(self, record: Record) -> None:
        self._lamp: Final = StateCell(record, "camera.lamp", "Q", ONE)
        self._exposure: Final = StateCell(record, "camera.exposure", "Q", ONE)
        self._since: Final = StateCell(record, "camera.exposed_at", "Q")

    @property
    def lamp(self) -> float:
        """Brightness of the lamp, 1 = as in the scene's pixels."""
        return self._lamp.value / ONE

    def set_lamp(self, brightness: float, cycle: int, frame_tcy: int) -> None:
        """Change the lamp at `cycle`. Automatic control continues from the exposure that it has reached by then."""
        self.hold(cycle, frame_tcy)
        self._lamp.value = round(brightness * ONE)

    def hold(self, cycle: int, frame_tcy: int) -> None:
        """Store the exposure that automatic control has reached at `cycle`. Call this before its target changes."""
        self._exposure.value = round(self._automatic(cycle, frame_tcy) * ONE)
        self._since.value = cycle

    def restart(self, cycle: int) -> None:
        """Restart exposure control after a sensor reset."""
        self._exposure.value, self._since.value = ONE, cycle

    def brightness(self, manual: float | None, cycle: int, frame_tcy: int) -> float:
        """Return the factor on the scene's pixels. `manual` is the manual exposure, None for automatic exposure."""
        lamp = self._lamp.value
        if manual is None:
            if lamp == ONE == self._exposure.value:
                return 1.0
            manual = self._automatic(cycle, frame_tcy)
        return lamp / ONE * manual

    def _automatic(self, cycle: int, frame_tcy: int) -> float:
        target = min(max(ONE / self._lamp.value, SHORTEST), LONGEST) if self._lamp.value else LONGEST
        start = self._exposure.value / ONE
        frames = max(cycle - self._since.value, 0) / frame_tcy
        difference = (start - target) * math.exp(-frames / FRAMES)
        return target if abs(difference) < _SETTLED * target else target + difference
