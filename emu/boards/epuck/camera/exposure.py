"""How bright the sensor makes the scene: lamp, manual exposure, and automatic exposure that follows (epuck.md §7.6).

A scene's pixel values are what the sensor shows of it at brightness 1. Automatic control approaches the exposure that
makes the lamp come out as 1, by a constant share per frame; so its state is a value, the cycle it was true at, and a
formula.
"""

from __future__ import annotations

import math
from typing import Final

from emu.peripherals.base import Cell
from emu.system.record import Record

FRAMES: Final = 2.0  # UNVERIFIED: 99 % after ten frames; §7.6 says 5 to 10 frames to converge
SHORTEST, LONGEST = 1 / 128, 8.0  # UNVERIFIED range of exposure and gain together
ONE: Final = 1 << 16
"""A brightness or exposure of 1, as cells have it."""
_SETTLED: Final = 1 / 256
"""A smaller rest is not seen in 8 bits: it counts as none."""


class Exposure:
    """State in cells `camera.lamp`, `camera.exposure` (in 1/`ONE`) and `camera.exposed_at`."""

    def __init__(self, record: Record) -> None:
        self._lamp: Final = Cell(record, "camera.lamp", "Q", ONE)
        self._exposure: Final = Cell(record, "camera.exposure", "Q", ONE)
        self._since: Final = Cell(record, "camera.exposed_at", "Q")

    @property
    def lamp(self) -> float:
        """Brightness of the scene, 1 = as its pixels say."""
        return self._lamp.value / ONE

    def set_lamp(self, brightness: float, cycle: int, frame_tcy: int) -> None:
        """The light changes in `cycle`; what automatic control has reached by then is where it goes on from."""
        self.hold(cycle, frame_tcy)
        self._lamp.value = round(brightness * ONE)

    def hold(self, cycle: int, frame_tcy: int) -> None:
        """Remember what automatic control has reached by `cycle`, before its course changes."""
        self._exposure.value = round(self._automatic(cycle, frame_tcy) * ONE)
        self._since.value = cycle

    def restart(self, cycle: int) -> None:
        """The sensor comes out of reset."""
        self._exposure.value, self._since.value = ONE, cycle

    def brightness(self, manual: float | None, cycle: int, frame_tcy: int) -> float:
        """Factor on the scene's pixels for a manual exposure, or the automatic one (None)."""
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
        rest = (start - target) * math.exp(-frames / FRAMES)
        return target if abs(rest) < _SETTLED * target else target + rest
