"""Lens model: rays of pixels by a pinhole camera with pitch, mirroring, distortion and vignetting (epuck.md §7.6).

Input: columns and rows of the upright 640 x 480 picture. Output: directions as (left per ahead, up per ahead). Without
pitch, mirroring and distortion u = 320 - 602 left and v = 240 - 602 up.
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
    """Lens of a mounted camera.

    `pitch_deg` is positive upwards. `mirrored` turns the sensor by 180 degrees. `distortion` is k: a pixel at distance
    r (in focal lengths) from the axis shows the point at r (1 + k r^2); positive values are a barrel distortion.
    """

    def __init__(self, pitch_deg: float = 0.0, mirrored: bool = False, distortion: float = 0.0) -> None:
        self._sin, self._cos = math.sin(math.radians(pitch_deg)), math.cos(math.radians(pitch_deg))
        self._mirrored = mirrored
        self._distortion = distortion
        edges = [self.line(v, np.array([0, _LAST_COLUMN])) for v in (0, _LAST_ROW)]
        self.widest: Final = max(float(np.abs(left).max()) for left, _ in edges) + 0.01
        """Bound of the lateral slope of all rays of the picture."""
        self._columns: dict[tuple[float, tuple[int, ...]], list[tuple[float, float]]] = {}

    def column(self, u: float, rows: tuple[int, ...]) -> list[tuple[float, float]]:
        """Return the rays (left, up) through some rows of a column."""
        rays = self._columns.get((u, rows))
        if rays is None:
            lines = [self.line(v, np.array([u], dtype=np.float64)) for v in rows]
            rays = self._columns[u, rows] = [(float(left[0]), float(up[0])) for left, up in lines]
        return rays

    def line(self, v: float, columns: NDArray[np.intp] | Floats) -> tuple[Floats, Floats]:
        """Return the rays (left, up) through some columns of a row."""
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
        """Return the brightness of some pixels of a row if the corners of the picture are darker by `share`."""
        across, down = columns.astype(np.float64) - dimensions.CENTRE_X, v - dimensions.CENTRE_Y
        corner = dimensions.CENTRE_X * dimensions.CENTRE_X + dimensions.CENTRE_Y * dimensions.CENTRE_Y
        bright: Floats = 1 - share / corner * (across * across + down * down)
        return bright


@cache
def _lens(pitch_deg: float, mirrored: bool, distortion: float) -> Lens:
    return Lens(pitch_deg, mirrored, distortion)


def lens_of(camera: CameraSetting, pitch_deg: float = 0.0) -> Lens:
    """Return the lens of a scene's camera with `pitch_deg` of additional pitch; equal lenses are one object."""
    return _lens(camera.pitch_deg + pitch_deg, camera.mirrored, camera.distortion)
