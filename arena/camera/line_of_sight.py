"""`LineOfSight`: the sensor of a robot without firmware, computed by native code (renderer.c and line_of_sight.c).

Input: poses. Output: OBJECT, ROBOT or NOTHING. A look costs about the same in a swarm of 10,000 robots as in one of
100: a grid over the bodies is filled once for all looks at the same poses.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import Structure, addressof, c_double, c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from arena.camera.appearance import NOTHING, OBJECT, ROBOT
from arena.camera.lens import Lens, lens_of
from arena.camera.view import Disc, RowRays, SceneBodies, bodies_of
from arena.scene.loader import Scene
from arena.scene.robot_kind import Traits
from arena.world.poses import Poses
from emu.native_library import ADDRESS, DOUBLE, INT, functions_of

WINDOW_COLUMNS: Final = tuple(240 + 8 * x for x in (6, 9, 12, 15))
WINDOW_ROWS: Final = tuple(160 + 8 * y for y in (4, 6, 8, 10, 12, 14))
"""The 24 pixels of the line-of-sight sensor in the whole picture. The clustering firmware takes every 8th pixel of the
160 x 160 in the middle (openswarm-original.md §8, revision A)."""
VOTES: Final = 2
"""Minimum number of pixels that must show an object or a robot for the sensor to report it."""


class _GridStruct(Structure):
    """`struct grid` of line_of_sight.c."""

    _fields_ = [*((name, c_double) for name in ("left", "low", "cell", "radius", "height")),
                *((name, c_int64) for name in ("columns", "rows", "robots", "bodies", "looks")),
                *((name, c_void_p) for name in ("first", "numbers", "visited"))]  # fmt: skip


@cache
def _code() -> dict[str, Callable[..., Any]]:
    """Return the functions of line_of_sight.c, which uses renderer.c."""
    texts = (Path(__file__).with_name(f"{name}.c").read_text("utf-8") for name in ("renderer", "line_of_sight"))
    return functions_of("".join(texts), "line_of_sight", {
        "fill_grid": (None, (ADDRESS, ADDRESS, INT, INT)),
        "look": (INT, (ADDRESS, ADDRESS, ADDRESS, DOUBLE, ADDRESS, ADDRESS, ADDRESS)),
    })  # fmt: skip


class _Grid:
    """Grid over the bodies of a scene, shared by the sensors of its robots. Native calls hold the GIL."""

    def __init__(self, bodies: SceneBodies) -> None:
        everything = [*bodies.robots, *bodies.objects]
        count = len(everything)
        self._cells: Final = np.zeros(2 * count + 2, dtype=np.int64), np.zeros(2 * count + 2, dtype=np.int64)
        self._numbers: Final = np.zeros(count, dtype=np.int64)
        self._struct: Final = _GridStruct(
            radius=max((one.radius for one in everything), default=0.0),
            height=max((one.height for one in everything), default=0.0),
            first=self._cells[0].ctypes.data, numbers=self._numbers.ctypes.data, visited=self._cells[1].ctypes.data,
        )  # fmt: skip
        self.address: Final = addressof(self._struct)
        """Address of the `struct grid`."""
        self._poses: Poses | None = None

    def fill(self, poses: Poses) -> None:
        """Sort the bodies at `poses` into cells, unless the grid already holds these poses."""
        if poses is not self._poses:
            self._poses = poses
            _code()["fill_grid"](self.address, poses.address, *poses.counts[:2])


_grids: Final[dict[int, tuple[SceneBodies, _Grid]]] = {}


def _grid_of(bodies: SceneBodies) -> _Grid:
    """Return the grid of a scene's bodies, from a cache if possible."""
    cached = _grids.get(id(bodies))
    if cached is None or cached[0] is not bodies:
        if len(_grids) > 16:
            _grids.clear()
        cached = _grids[id(bodies)] = bodies, _Grid(bodies)
    return cached[1]


@cache
def _window(lens: Lens) -> RowRays:
    """Return the rays of the sensor's pixels."""
    left, up = np.array([ray for u in WINDOW_COLUMNS for ray in lens.column(u, WINDOW_ROWS)]).T
    return RowRays(left, up)


class LineOfSight:
    """Line-of-sight sensor of robot `own` in a scene; `traits` are the deviations of its mounting."""

    def __init__(self, scene: Scene, own: int, traits: Traits = Traits()) -> None:  # noqa: B008 - never changes
        self._look: Final = _code()["look"]
        lens = lens_of(scene.camera, traits.pitch_deg)
        self._bodies: Final = bodies_of(scene)
        self._grid: Final = _grid_of(self._bodies)
        self._view: Final = self._bodies.view(scene, own, traits, lens, self._bodies.robots, (Disc * 1)(), None)
        self._window: Final = _window(lens).address
        self._addresses: Final = self._grid.address, self._bodies.sensor_classes.ctypes.data
        self._address: Final = addressof(self._view)
        self._counts: tuple[int, int, int] | None = None

    def look(self, poses: Poses, before: Poses | None = None, quanta: float = 0.0) -> int:
        """Return OBJECT, ROBOT or NOTHING by the votes of the window's pixels, with ideal colours.

        The robot looks from its pose in `poses`, extrapolated by `quanta` of the motion since `before`. Raises
        ValueError for poses of more bodies than the scene has.
        """
        if poses.counts != self._counts:
            self._bodies.show(self._view, poses)
            self._counts = poses.counts
        self._grid.fill(poses)
        address = poses.address
        votes = self._look(self._address, address, address if before is None else before.address, quanta,
                           self._window, *self._addresses)  # fmt: skip
        objects, robots = divmod(votes, 256)
        return OBJECT if objects >= VOTES else ROBOT if robots >= VOTES else NOTHING
