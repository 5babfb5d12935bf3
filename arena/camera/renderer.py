"""`Renderer`: the picture of a robot's camera, computed by native code (renderer.c).

Input: poses. Output: pixel classes, colours, and the answer of the line-of-sight sensor. `ReferenceCamera` in
tests/arena/reference_camera.py is the specification; the tests compare both.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import POINTER, Structure, addressof, c_double, c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from arena.camera.appearance import COLOURS, LED_POSITIONS, NOTHING, OBJECT, ROBOT, appearance_of, led_classes
from arena.camera.lens import Floats, lens_of
from arena.scene import dimensions
from arena.scene.loader import Scene
from arena.scene.robot_kind import Traits
from arena.world.poses import Poses
from emu.native_library import ADDRESS, DOUBLE, INT, address_of, functions

NEAREST: Final = 0.05
"""Smallest depth in cm of a hit; a body that touches the lens is at this depth."""
ROWS_CACHED: Final = 2048
"""Rows whose rays are cached: more than any setting of a sensor has."""
WINDOW_COLUMNS: Final = tuple(240 + 8 * x for x in (6, 9, 12, 15))
WINDOW_ROWS: Final = tuple(160 + 8 * y for y in (4, 6, 8, 10, 12, 14))
"""The 24 pixels of the line-of-sight sensor in the whole picture. The clustering firmware takes every 8th pixel of the
160 x 160 in the middle (openswarm-original.md §8, revision A)."""
VOTES: Final = 2
"""Pixels that must show an object or a robot for the sensor to report it."""


class _Disc(Structure):
    """`struct disc` of renderer.c."""

    _fields_ = [*((name, c_double) for name in ("ahead", "left", "radius", "height")), ("class", c_int64),
                ("leds", c_int64), ("cos", c_double), ("sin", c_double)]  # fmt: skip


class _Led(Structure):
    """`struct led` of renderer.c."""

    _fields_ = [(name, c_double) for name in ("forward", "left", "low", "high")]


class _Side(Structure):
    """`struct side` of renderer.c."""

    _fields_ = [*((name, c_double) for name in ("ax", "ay", "bx", "by", "height")), ("class", c_int64),
                ("range", c_double)]  # fmt: skip


class _Polygon(Structure):
    """`struct polygon` of renderer.c."""

    _fields_ = [("corners", c_void_p), ("count", c_int64), ("object", c_int64), ("height", c_double),
                ("class", c_int64)]  # fmt: skip


class _Patch(Structure):
    """`struct patch` of renderer.c."""

    _fields_ = [("x", c_double), ("y", c_double), ("radius", c_double), ("corners", c_void_p), ("count", c_int64),
                ("class", c_int64)]  # fmt: skip


class _View(Structure):
    """`struct view` of renderer.c."""

    _fields_ = [
        *((name, c_double) for name in ("camera_ahead", "camera_height", "wall_height", "nearest", "width", "height",
                                        "range", "widest", "yaw")),
        *((name, c_int64) for name in ("own", "robots", "objects", "is_furnished")),
        ("lit", c_void_p), ("led_positions", POINTER(_Led)),
        *((name, c_int64) for name in ("led_count", "led_class", "body_class")), ("led_cos", c_double),
        ("robot_discs", POINTER(_Disc)), ("object_discs", POINTER(_Disc)),
        ("fixed", POINTER(_Disc)), ("fixed_count", c_int64), ("outlines", POINTER(_Side)), ("outline_count", c_int64),
        ("patches", POINTER(_Patch)), ("patch_count", c_int64),
        ("discs", POINTER(_Disc)), ("disc_count", c_int64), ("sides", POINTER(_Side)), ("side_count", c_int64),
        ("polygons", POINTER(_Polygon)), ("polygon_count", c_int64),
        ("x", c_double), ("y", c_double), ("cos", c_double), ("sin", c_double),
    ]  # fmt: skip


class _Rays(Structure):
    """`struct rays` of renderer.c."""

    _fields_ = [("left", c_void_p), ("up", c_void_p), ("count", c_int64), ("right_most", c_double),
                ("left_most", c_double), ("seen", c_void_p), ("pixels", c_void_p),
                ("brightness", c_void_p)]  # fmt: skip


@cache
def _code() -> dict[str, Callable[..., Any]]:
    """Return the functions of renderer.c."""
    return functions(Path(__file__).with_name("renderer.c"), {
        "set_viewpoint": (None, (ADDRESS, ADDRESS, ADDRESS, DOUBLE)),
        "classify_rays": (None, (ADDRESS, ADDRESS)),
        "window_votes": (INT, (ADDRESS, ADDRESS, ADDRESS)),
        "render_line": (None, (ADDRESS, ADDRESS, ADDRESS, DOUBLE, ADDRESS, ADDRESS, ADDRESS)),
    })  # fmt: skip


class _SceneBodies:
    """Appearance of all bodies of a scene, shared by its cameras."""

    def __init__(self, scene: Scene) -> None:
        appearance = appearance_of(scene) if scene.is_furnished else None
        count = scene.objects.count
        plain = (scene.objects.radius_cm, dimensions.OBJECT_HEIGHT, OBJECT)
        objects = appearance.objects if appearance is not None else [plain] * count
        self.objects: Final = (_Disc * count)(*(_Disc(0.0, 0.0, *one) for one in objects))
        fixed, sides, patches = (
            (appearance.discs, appearance.sides, appearance.patches) if appearance is not None else ([], [], [])
        )
        self.fixed: Final = (_Disc * len(fixed))(*(_Disc(*one) for one in fixed))
        self.outlines: Final = (_Side * len(sides))(
            *(_Side(*ends, height, kind, math.inf) for ends, height, kind in sides)
        )
        polygons = appearance.polygons if appearance is not None else []
        self.polygon_corners: Final = [np.array(corners, dtype=np.float64) for _, corners, _, _ in polygons]
        self.polygons: Final = (_Polygon * len(polygons))(*(
            _Polygon(corners.ctypes.data, len(corners), number, height, kind)
            for (number, _, height, kind), corners in zip(polygons, self.polygon_corners, strict=True)
        ))  # fmt: skip
        self.corners: Final = [np.array(patch.polygon or [], dtype=np.float64).reshape(-1, 2) for patch, _ in patches]
        self.patches: Final = (_Patch * len(patches))(*(
            _Patch(patch.x_cm, patch.y_cm, patch.radius_cm, corners.ctypes.data, len(corners), kind)
            for (patch, kind), corners in zip(patches, self.corners, strict=True)
        ))  # fmt: skip
        sensor_classes = appearance.sensor_classes if appearance is not None else range(len(COLOURS))
        self.sensor_classes: Final = np.array(sensor_classes, dtype=np.uint8)
        robot = appearance.robot if appearance is not None else ROBOT
        kinds = map(scene.robot_kind, range(scene.robots.count))
        self.robots: Final = (_Disc * scene.robots.count)(*(
            _Disc(0.0, 0.0, kind.radius_cm, kind.height_cm, robot) for kind in kinds
        ))  # fmt: skip
        self.led_positions: Final = (_Led * len(LED_POSITIONS))(*(_Led(*one) for one in LED_POSITIONS))
        self.led_classes: Final = led_classes(scene)


_cache: dict[int, tuple[Scene, _SceneBodies]] = {}


def _bodies_of(scene: Scene) -> _SceneBodies:
    """Return the bodies of a scene, from a cache if possible."""
    cached = _cache.get(id(scene))
    if cached is None or cached[0] is not scene:
        if len(_cache) > 16:
            _cache.clear()
        cached = _cache[id(scene)] = scene, _SceneBodies(scene)
    return cached[1]


class RowRays:
    """Rays of the pixels of a row, with room for their classes and colours (`struct rays`)."""

    def __init__(self, left: Floats, up: Floats, columns: NDArray[np.intp] | None = None,
                 brightness: Floats | None = None) -> None:  # fmt: skip
        self._arrays: Final = np.ascontiguousarray(left), np.ascontiguousarray(up), brightness
        self.columns: Final = columns
        """Columns of the pixels. The reference keeps the array alive, because its id is the cache key."""
        self.seen: Final = np.zeros(len(left), dtype=np.uint8)
        self.pixels: Final = np.zeros((len(left), 3), dtype=np.uint8)
        """Red, green and blue of the last rendering."""
        self._rays: Final = _Rays(self._arrays[0].ctypes.data, self._arrays[1].ctypes.data, len(left),
                                  float(np.min(left)), float(np.max(left)), self.seen.ctypes.data,
                                  self.pixels.ctypes.data,
                                  None if brightness is None else brightness.ctypes.data)  # fmt: skip
        self.address: Final = addressof(self._rays)
        """Address of the `struct rays`."""


class Renderer:
    """Renderer of the camera of robot `own` in a scene; `traits` are the deviations of its mounting."""

    def __init__(self, scene: Scene, own: int, traits: Traits = Traits()) -> None:  # noqa: B008 - never changes
        code = _code()
        self._set_viewpoint, self._classify_rays = code["set_viewpoint"], code["classify_rays"]
        self._window_votes, self._render_line = code["window_votes"], code["render_line"]
        self.lens: Final = lens_of(scene.camera, traits.pitch_deg)
        bodies = _bodies_of(scene)
        self._bodies: Final = bodies
        self.leds: Final = np.zeros(scene.robots.count, dtype=np.int64)
        """Lit LEDs of each robot, bit n: ring LED n, 8 front, 9 body; used in scenes with `camera.sees_leds`."""
        self._robot_discs: Final = type(bodies.robots).from_buffer_copy(bodies.robots)
        self._discs: Final = (_Disc * (len(bodies.objects) + scene.robots.count))()
        self._sides: Final = (_Side * (len(bodies.outlines) + sum(map(len, bodies.polygon_corners))))()
        self._view: Final = _View(
            dimensions.CAMERA_AHEAD, dimensions.CAMERA_HEIGHT, dimensions.WALL_HEIGHT, NEAREST,
            *scene.arena.extent, scene.camera.range_cm, self.lens.widest, traits.yaw,
            own, scene.robots.count, len(bodies.objects), scene.is_furnished,
            self.leds.ctypes.data if scene.camera.sees_leds else None, bodies.led_positions,
            len(bodies.led_positions), *bodies.led_classes, dimensions.LED_COS,
            self._robot_discs, bodies.objects, bodies.fixed, len(bodies.fixed), bodies.outlines, len(bodies.outlines),
            bodies.patches, len(bodies.patches), self._discs, 0, self._sides, 0,
            bodies.polygons, len(bodies.polygons),
        )  # fmt: skip
        self._address: Final = addressof(self._view)
        self._counts = scene.robots.count, len(bodies.objects), len(bodies.polygons)
        self._sensor_classes: Final = bodies.sensor_classes.ctypes.data
        self._rows: Final[dict[tuple[float, int], RowRays]] = {}
        self._vignetting: Final = scene.camera.vignetting
        self._window: RowRays | None = None

    def set_viewpoint(self, poses: Poses, before: Poses | None = None, quanta: float = 0.0) -> None:
        """Set the viewpoint to the own pose in `poses`, extrapolated by `quanta` of the motion since `before`."""
        if poses.counts != self._counts:
            self._adapt(poses)
        address = poses.address
        self._set_viewpoint(self._address, address, address if before is None else before.address, quanta)

    def _adapt(self, poses: Poses) -> None:
        """Accept poses of fewer robots or objects than the scene has, as in tests and replays."""
        robots, objects, polygons = poses.counts
        if objects > len(self._bodies.objects) or robots > len(self.leds):
            raise ValueError(f"{robots} robots and {objects} objects are more than the scene has")
        if polygons != sum(one.object < objects for one in self._bodies.polygons):
            raise ValueError(f"{polygons} polygons are not those of the scene's first {objects} objects")
        self._counts = poses.counts
        self._view.robots, self._view.objects, self._view.polygon_count = poses.counts

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

    def line_of_sight(self) -> int:
        """Return OBJECT, ROBOT or NOTHING by the votes of the window's pixels, with ideal colours."""
        if self._window is None:
            rays = [ray for u in WINDOW_COLUMNS for ray in self.lens.column(u, WINDOW_ROWS)]
            left, up = np.array(rays).T
            self._window = RowRays(left, up)
        objects, robots = divmod(self._window_votes(self._address, self._window.address, self._sensor_classes), 256)
        return OBJECT if objects >= VOTES else ROBOT if robots >= VOTES else NOTHING

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
