"""What native code needs of a camera in a scene: bodies, viewpoint and rays (the structures of renderer.c)."""

from __future__ import annotations

import math
from ctypes import POINTER, Array, Structure, addressof, c_double, c_int64, c_void_p
from typing import Final

import numpy as np
from numpy.typing import NDArray

from arena.camera.appearance import COLOURS, LED_POSITIONS, OBJECT, ROBOT, appearance_of, led_classes
from arena.camera.lens import Floats, Lens
from arena.scene import dimensions
from arena.scene.loader import Scene
from arena.scene.robot_kind import Traits
from arena.world.poses import Poses

NEAREST: Final = 0.05
"""Smallest depth in cm of a hit; a body that touches the lens is at this depth."""


class Disc(Structure):
    """`struct disc` of renderer.c."""

    _fields_ = [*((name, c_double) for name in ("ahead", "left", "radius", "height")), ("class", c_int64),
                ("leds", c_int64), ("cos", c_double), ("sin", c_double)]  # fmt: skip


class Led(Structure):
    """`struct led` of renderer.c."""

    _fields_ = [(name, c_double) for name in ("forward", "left", "low", "high")]


class Side(Structure):
    """`struct side` of renderer.c."""

    _fields_ = [*((name, c_double) for name in ("ax", "ay", "bx", "by", "height")), ("class", c_int64),
                ("range", c_double)]  # fmt: skip


class Polygon(Structure):
    """`struct polygon` of renderer.c."""

    _fields_ = [("corners", c_void_p), ("count", c_int64), ("object", c_int64), ("height", c_double),
                ("class", c_int64)]  # fmt: skip


class Patch(Structure):
    """`struct patch` of renderer.c."""

    _fields_ = [("x", c_double), ("y", c_double), ("radius", c_double), ("corners", c_void_p), ("count", c_int64),
                ("class", c_int64)]  # fmt: skip


class View(Structure):
    """`struct view` of renderer.c."""

    _fields_ = [
        *((name, c_double) for name in ("camera_ahead", "camera_height", "wall_height", "nearest", "width", "height",
                                        "range", "widest", "yaw")),
        *((name, c_int64) for name in ("own", "robots", "objects", "is_furnished")),
        ("lit", c_void_p), ("led_positions", POINTER(Led)),
        *((name, c_int64) for name in ("led_count", "led_class", "body_class")), ("led_cos", c_double),
        ("robot_discs", POINTER(Disc)), ("object_discs", POINTER(Disc)),
        ("fixed", POINTER(Disc)), ("fixed_count", c_int64), ("outlines", POINTER(Side)), ("outline_count", c_int64),
        ("patches", POINTER(Patch)), ("patch_count", c_int64),
        ("discs", POINTER(Disc)), ("disc_count", c_int64), ("sides", POINTER(Side)), ("side_count", c_int64),
        ("polygons", POINTER(Polygon)), ("polygon_count", c_int64),
        ("x", c_double), ("y", c_double), ("cos", c_double), ("sin", c_double),
    ]  # fmt: skip


class Rays(Structure):
    """`struct rays` of renderer.c."""

    _fields_ = [("left", c_void_p), ("up", c_void_p), ("count", c_int64), ("right_most", c_double),
                ("left_most", c_double), ("seen", c_void_p), ("pixels", c_void_p),
                ("brightness", c_void_p)]  # fmt: skip


class SceneBodies:
    """Appearance of all bodies of a scene, shared by its cameras."""

    def __init__(self, scene: Scene) -> None:
        appearance = appearance_of(scene) if scene.is_furnished else None
        count = scene.objects.count
        plain = (scene.objects.radius_cm, dimensions.OBJECT_HEIGHT, OBJECT)
        objects = appearance.objects if appearance is not None else [plain] * count
        self.objects: Final = (Disc * count)(*(Disc(0.0, 0.0, *one) for one in objects))
        fixed, sides, patches = (
            (appearance.discs, appearance.sides, appearance.patches) if appearance is not None else ([], [], [])
        )
        self.fixed: Final = (Disc * len(fixed))(*(Disc(*one) for one in fixed))
        self.outlines: Final = (Side * len(sides))(
            *(Side(*ends, height, kind, math.inf) for ends, height, kind in sides)
        )
        polygons = appearance.polygons if appearance is not None else []
        self.polygon_corners: Final = [np.array(corners, dtype=np.float64) for _, corners, _, _ in polygons]
        self.polygons: Final = (Polygon * len(polygons))(*(
            Polygon(corners.ctypes.data, len(corners), number, height, kind)
            for (number, _, height, kind), corners in zip(polygons, self.polygon_corners, strict=True)
        ))  # fmt: skip
        self.corners: Final = [np.array(patch.polygon or [], dtype=np.float64).reshape(-1, 2) for patch, _ in patches]
        self.patches: Final = (Patch * len(patches))(*(
            Patch(patch.x_cm, patch.y_cm, patch.radius_cm, corners.ctypes.data, len(corners), kind)
            for (patch, kind), corners in zip(patches, self.corners, strict=True)
        ))  # fmt: skip
        sensor_classes = appearance.sensor_classes if appearance is not None else range(len(COLOURS))
        self.sensor_classes: Final = np.array(sensor_classes, dtype=np.uint8)
        robot = appearance.robot if appearance is not None else ROBOT
        kinds = map(scene.robot_kind, range(scene.robots.count))
        self.robots: Final = (Disc * scene.robots.count)(*(
            Disc(0.0, 0.0, kind.radius_cm, kind.height_cm, robot) for kind in kinds
        ))  # fmt: skip
        self.led_positions: Final = (Led * len(LED_POSITIONS))(*(Led(*one) for one in LED_POSITIONS))
        self.led_classes: Final = led_classes(scene)

    def view(self, scene: Scene, own: int, traits: Traits, lens: Lens, robots: Array[Disc], room: Array[Disc],
             lit: int | None) -> View:  # fmt: skip
        """Return the view of robot `own`, whose camera is mounted with `traits`.

        `robots` are the discs of the robots, `room` is space for the discs in view, and `lit` is the address of the lit
        LEDs of each robot.
        """
        sides = (Side * (len(self.outlines) + sum(map(len, self.polygon_corners))))()
        return View(
            dimensions.CAMERA_AHEAD, dimensions.CAMERA_HEIGHT, dimensions.WALL_HEIGHT, NEAREST,
            *scene.arena.extent, scene.camera.range_cm, lens.widest, traits.yaw,
            own, len(self.robots), len(self.objects), scene.is_furnished,
            lit, self.led_positions, len(self.led_positions), *self.led_classes, dimensions.LED_COS,
            robots, self.objects, self.fixed, len(self.fixed), self.outlines, len(self.outlines),
            self.patches, len(self.patches), room, 0, sides, 0, self.polygons, len(self.polygons),
        )  # fmt: skip

    def show(self, view: View, poses: Poses) -> None:
        """Adapt a view to poses of fewer robots or objects than the scene has, as in tests and replays.

        Raises ValueError for poses of more bodies.
        """
        robots, objects, polygons = poses.counts
        if objects > len(self.objects) or robots > len(self.robots):
            raise ValueError(f"{robots} robots and {objects} objects are more than the scene has")
        if polygons != sum(one.object < objects for one in self.polygons):
            raise ValueError(f"{polygons} polygons are not those of the scene's first {objects} objects")
        view.robots, view.objects, view.polygon_count = poses.counts


_cache: dict[int, tuple[Scene, SceneBodies]] = {}


def bodies_of(scene: Scene) -> SceneBodies:
    """Return the bodies of a scene, from a cache if possible."""
    cached = _cache.get(id(scene))
    if cached is None or cached[0] is not scene:
        if len(_cache) > 16:
            _cache.clear()
        cached = _cache[id(scene)] = scene, SceneBodies(scene)
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
        self._rays: Final = Rays(self._arrays[0].ctypes.data, self._arrays[1].ctypes.data, len(left),
                                  float(np.min(left)), float(np.max(left)), self.seen.ctypes.data,
                                  self.pixels.ctypes.data,
                                  None if brightness is None else brightness.ctypes.data)  # fmt: skip
        self.address: Final = addressof(self._rays)
        """Address of the `struct rays`."""
