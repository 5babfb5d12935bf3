"""`Renderer`: the picture of a robot's camera, computed by native code (renderer.c).

Input: poses. Output: pixel classes and colours. `ReferenceCamera` in tests/arena/reference_camera.py is the
specification; the tests compare both.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import addressof
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from arena.camera.lens import lens_of
from arena.camera.view import Disc, RowRays, bodies_of
from arena.scene.loader import Scene
from arena.scene.robot_kind import Traits
from arena.world.poses import Poses
from emu.native_library import ADDRESS, DOUBLE, address_of, functions

ROWS_CACHED: Final = 2048
"""Maximum number of rows whose rays are cached: more than any setting of a sensor has."""


@cache
def _code() -> dict[str, Callable[..., Any]]:
    """Return the functions of renderer.c."""
    return functions(Path(__file__).with_name("renderer.c"), {
        "set_viewpoint": (None, (ADDRESS, ADDRESS, ADDRESS, DOUBLE)),
        "classify_rays": (None, (ADDRESS, ADDRESS)),
        "render_line": (None, (ADDRESS, ADDRESS, ADDRESS, DOUBLE, ADDRESS, ADDRESS, ADDRESS)),
    })  # fmt: skip


class Renderer:
    """Renderer of the camera of robot `own` in a scene; `traits` are the deviations of its mounting."""

    def __init__(self, scene: Scene, own: int, traits: Traits = Traits()) -> None:  # noqa: B008 - never changes
        code = _code()
        self._set_viewpoint, self._classify_rays = code["set_viewpoint"], code["classify_rays"]
        self._render_line = code["render_line"]
        self.lens: Final = lens_of(scene.camera, traits.pitch_deg)
        bodies = bodies_of(scene)
        self._bodies: Final = bodies
        self.leds: Final = np.zeros(scene.robots.count, dtype=np.int64)
        """Lit LEDs of each robot, bit n: ring LED n, 8 front, 9 body; used in scenes with `camera.sees_leds`."""
        robots = type(bodies.robots).from_buffer_copy(bodies.robots)
        room = (Disc * (len(bodies.objects) + len(bodies.robots)))()
        lit = self.leds.ctypes.data if scene.camera.sees_leds else None
        self._view: Final = bodies.view(scene, own, traits, self.lens, robots, room, lit)
        self._address: Final = addressof(self._view)
        self._counts: tuple[int, int, int] | None = None
        """Numbers of bodies that the view is adapted to."""
        self._rows: Final[dict[tuple[float, int], RowRays]] = {}
        self._vignetting: Final = scene.camera.vignetting

    def set_viewpoint(self, poses: Poses, before: Poses | None = None, quanta: float = 0.0) -> None:
        """Set the viewpoint to the own pose in `poses`, extrapolated by `quanta` of the motion since `before`."""
        if poses.counts != self._counts:
            self._adapt(poses)
        address = poses.address
        self._set_viewpoint(self._address, address, address if before is None else before.address, quanta)

    def _adapt(self, poses: Poses) -> None:
        """Accept poses of another number of bodies. Raises ValueError."""
        self._bodies.show(self._view, poses)
        self._counts = poses.counts

    def classify_row(self, v: int, columns: NDArray[np.intp]) -> NDArray[np.uint8]:
        """Return the pixel classes of one row in some columns, valid until the next call for that row."""
        rays = self.row_rays(v, columns)
        self._classify_rays(self._address, rays.address)
        return rays.seen

    def render_line(
        self, poses: Poses, before: Poses, quanta: float, v: int, columns: NDArray[np.intp], colours: int, noise: int
    ) -> NDArray[np.uint8]:
        """Set the viewpoint and return red, green and blue of the pixels of a row, valid until the next call for it.

        `colours` is the address of the 16-bit colours of each class, `noise` that of the 16-bit noise of each value.
        """
        if poses.counts != self._counts:
            self._adapt(poses)
        rays = self._rows.get((v, id(columns))) or self.row_rays(v, columns)
        self._render_line(self._address, poses.address, before.address, quanta, rays.address, colours, noise)
        return rays.pixels

    def native_handle(self) -> tuple[int, int]:
        """Return the addresses of `render_line` of renderer.c and of the `struct view`."""
        return address_of(self._render_line), self._address

    def row_rays(self, v: int, columns: NDArray[np.intp]) -> RowRays:
        """Return the rays of a row, from a cache if possible. Native callers must keep the object alive."""
        key = v, id(columns)
        rays = self._rows.get(key)
        if rays is None:
            if len(self._rows) >= ROWS_CACHED:
                self._rows.clear()
            brightness = self.lens.vignetting(v, columns, self._vignetting) if self._vignetting else None
            rays = self._rows[key] = RowRays(*self.lens.line(v, columns), columns, brightness)
        return rays
