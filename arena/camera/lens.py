"""From pixels to rays: pinhole, and what a real camera adds to it (epuck.md §7.6). What enters: columns and rows of the
upright 640 x 480 picture; what leaves: directions as (left per ahead, up per ahead).

Without pitch, mirror and distortion it is u = 320 - 602 left, v = 240 - 602 up.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from arena.scene import dimensions
from arena.scene.loader import CameraSetting

_LAST_COLUMN, _LAST_ROW = 639, 479
Floats = NDArray[np.float64]


class Lens:
    """A camera as it is mounted: `pitch_deg` up positive, `mirrored` as if the sensor stood on its head, `distortion`
    k: a pixel at distance r (in focal lengths) from the axis shows what is at r (1 + k r^2); positive is a barrel."""

    def __init__(self, pitch_deg: float = 0.0, mirrored: bool = False, distortion: float = 0.0) -> None:
        self._sin, self._cos = math.sin(math.radians(pitch_deg)), math.cos(math.radians(pitch_deg))
        self._mirrored = mirrored
        self._distortion = distortion
        edges = [self.line(v, np.array([0, _LAST_COLUMN])) for v in (0, _LAST_ROW)]
        self.widest: Final = max(float(np.abs(left).max()) for left, _ in edges) + 0.01
        """No ray of the picture has a larger slope to the side."""
        self._columns: dict[tuple[float, tuple[int, ...]], list[tuple[float, float]]] = {}

    def column(self, u: float, rows: tuple[int, ...]) -> list[tuple[float, float]]:
        """The rays (left, up) through some rows of a column."""
        rays = self._columns.get((u, rows))
        if rays is None:
            lines = [self.line(v, np.array([u], dtype=np.float64)) for v in rows]
            rays = self._columns[u, rows] = [(float(left[0]), float(up[0])) for left, up in lines]
        return rays

    def line(self, v: float, columns: NDArray[np.intp] | Floats) -> tuple[Floats, Floats]:
        """The rays (left, up) through some columns of a row."""
        if self._mirrored:
            v, columns = _LAST_ROW - v, _LAST_COLUMN - columns
        left: Floats = (dimensions.CENTRE_X - columns.astype(np.float64)) / dimensions.FOCAL_PIXELS
        up: Floats = np.full(len(left), (dimensions.CENTRE_Y - v) / dimensions.FOCAL_PIXELS)
        if self._distortion:
            stretch = 1 + self._distortion * (left * left + up * up)
            left, up = np.multiply(left, stretch), np.multiply(up, stretch)
        if self._sin:
            ahead = self._cos - up * self._sin
            left, up = left / ahead, (up * self._cos + self._sin) / ahead
        return left, up

    def vignetting(self, v: float, columns: NDArray[np.intp], share: float) -> Floats:
        """Brightness of some pixels of a row if the corners of the picture are darker by `share`."""
        across, down = columns.astype(np.float64) - dimensions.CENTRE_X, v - dimensions.CENTRE_Y
        corner = dimensions.CENTRE_X * dimensions.CENTRE_X + dimensions.CENTRE_Y * dimensions.CENTRE_Y
        bright: Floats = 1 - share / corner * (across * across + down * down)
        return bright


@cache
def _lens(pitch_deg: float, mirrored: bool, distortion: float) -> Lens:
    return Lens(pitch_deg, mirrored, distortion)


def lens_of(camera: CameraSetting, pitch_deg: float = 0.0) -> Lens:
    """The lens of a scene's camera, of a robot whose camera looks up by so much more; one per process for the same
    values."""
    return _lens(camera.pitch_deg + pitch_deg, camera.mirrored, camera.distortion)
