"""`Sight`: what a robot's camera sees, by compiled code (`sight.c`). What it computes, `vision.Eye` defines; the tests
compare the two. Poses in; classes of pixels, colours, votes of the sensor out.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import POINTER, Structure, addressof, c_double, c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from arena.camera.appearance import COLOURS, LAMPS, NOTHING, OBJECT, ROBOT, led_kinds, look_of
from arena.camera.lens import Floats, lens_of
from arena.camera.reference import NEAREST, VOTES, WINDOW_COLUMNS, WINDOW_ROWS
from arena.scene import dimensions
from arena.scene.loader import Scene
from arena.world.physics import Poses, Traits
from emu.native_library import ADDRESS, DOUBLE, INT, address_of, functions

ROWS_KEPT: Final = 2048
"""Rows whose rays are remembered: more than any setting of a sensor has."""


class _Disc(Structure):
    _fields_ = [*((name, c_double) for name in ("ahead", "left", "radius", "height")), ("kind", c_int64),
                ("leds", c_int64), ("cos", c_double), ("sin", c_double)]  # fmt: skip


class _Lamp(Structure):
    _fields_ = [(name, c_double) for name in ("forward", "left", "low", "high")]


class _Side(Structure):
    _fields_ = [(name, c_double) for name in ("ax", "ay", "bx", "by", "height")] + [("kind", c_int64)]


class _Patch(Structure):
    _fields_ = [("x", c_double), ("y", c_double), ("radius", c_double), ("corners", c_void_p), ("count", c_int64),
                ("kind", c_int64)]  # fmt: skip


class _View(Structure):
    _fields_ = [
        *((name, c_double) for name in ("camera_ahead", "camera_height", "wall_height", "nearest", "width", "height",
                                        "range", "widest", "yaw")),
        *((name, c_int64) for name in ("own", "robots", "objects", "is_furnished")),
        ("leds", c_void_p), ("lamps", POINTER(_Lamp)),
        *((name, c_int64) for name in ("lamp_count", "led_kind", "body_kind")), ("led_cos", c_double),
        ("robot", _Disc), ("things", POINTER(_Disc)),
        ("fixed", POINTER(_Disc)), ("fixed_count", c_int64), ("outlines", POINTER(_Side)), ("outline_count", c_int64),
        ("patches", POINTER(_Patch)), ("patch_count", c_int64),
        ("discs", POINTER(_Disc)), ("disc_count", c_int64), ("sides", POINTER(_Side)), ("side_count", c_int64),
        ("x", c_double), ("y", c_double), ("cos", c_double), ("sin", c_double),
    ]  # fmt: skip


class _Rays(Structure):
    _fields_ = [("left", c_void_p), ("up", c_void_p), ("count", c_int64), ("right_most", c_double),
                ("left_most", c_double), ("seen", c_void_p), ("pixels", c_void_p), ("bright", c_void_p)]  # fmt: skip


@cache
def _code() -> dict[str, Callable[..., Any]]:
    return functions(Path(__file__).with_name("renderer.c"), {
        "collect": (None, (ADDRESS, ADDRESS, ADDRESS, DOUBLE)),
        "classes": (None, (ADDRESS, ADDRESS)),
        "votes": (INT, (ADDRESS, ADDRESS, ADDRESS)),
        "line": (None, (ADDRESS, ADDRESS, ADDRESS, DOUBLE, ADDRESS, ADDRESS, ADDRESS)),
    })  # fmt: skip


class _Things:
    """What all cameras of a scene share: what things look like."""

    def __init__(self, scene: Scene) -> None:
        look = look_of(scene) if scene.is_furnished else None
        count = scene.objects.count
        plain = (scene.objects.radius_cm, dimensions.OBJECT_HEIGHT, OBJECT)
        objects = look.objects if look is not None else [plain] * count
        self.things: Final = (_Disc * count)(*(_Disc(0.0, 0.0, *one) for one in objects))
        fixed, sides, patches = (look.discs, look.sides, look.patches) if look is not None else ([], [], [])
        self.fixed: Final = (_Disc * len(fixed))(*(_Disc(*one) for one in fixed))
        self.outlines: Final = (_Side * len(sides))(*(_Side(*ends, height, kind) for ends, height, kind in sides))
        self.corners: Final = [np.array(patch.polygon or [], dtype=np.float64).reshape(-1, 2) for patch, _ in patches]
        self.patches: Final = (_Patch * len(patches))(*(
            _Patch(patch.x_cm, patch.y_cm, patch.radius_cm, corners.ctypes.data, len(corners), kind)
            for (patch, kind), corners in zip(patches, self.corners, strict=True)
        ))  # fmt: skip
        sensed = look.sensed if look is not None else range(len(COLOURS))
        self.sensed: Final = np.array(sensed, dtype=np.uint8)
        self.lamps: Final = (_Lamp * len(LAMPS))(*(_Lamp(*one) for one in LAMPS))
        self.kinds: Final = led_kinds(scene)


_kept: dict[int, tuple[Scene, _Things]] = {}


def _things_of(scene: Scene) -> _Things:
    kept = _kept.get(id(scene))
    if kept is None or kept[0] is not scene:
        if len(_kept) > 16:
            _kept.clear()
        kept = _kept[id(scene)] = scene, _Things(scene)
    return kept[1]


class Fan:
    """Rays in the form the code wants, with room for what they meet."""

    def __init__(self, left: Floats, up: Floats, columns: NDArray[np.intp] | None = None,
                 bright: Floats | None = None) -> None:  # fmt: skip
        self._arrays: Final = np.ascontiguousarray(left), np.ascontiguousarray(up), bright
        self.columns: Final = columns
        """What it is known by: it lives as long."""
        self.seen: Final = np.zeros(len(left), dtype=np.uint8)
        self.pixels: Final = np.zeros((len(left), 3), dtype=np.uint8)
        """Red, green and blue as they were painted last."""
        self._rays: Final = _Rays(self._arrays[0].ctypes.data, self._arrays[1].ctypes.data, len(left),
                                  float(np.min(left)), float(np.max(left)), self.seen.ctypes.data,
                                  self.pixels.ctypes.data, None if bright is None else bright.ctypes.data)  # fmt: skip
        self.address: Final = addressof(self._rays)
        """Of `struct rays`."""


class Sight:
    """The camera of robot `own` in a scene; `traits` say how it is mounted."""

    def __init__(self, scene: Scene, own: int, traits: Traits = Traits()) -> None:  # noqa: B008 - never changes
        code = _code()
        self._collect, self._classes = code["collect"], code["classes"]
        self._votes, self._line = code["votes"], code["line"]
        self.lens: Final = lens_of(scene.camera, traits.pitch_deg)
        things = _things_of(scene)
        self._things: Final = things
        self.leds: Final = np.zeros(scene.robots.count, dtype=np.int64)
        """Of each robot, bit n: LED n is lit as it is seen, 8 front, 9 body; for scenes that want it."""
        self._discs: Final = (_Disc * (len(things.things) + scene.robots.count))()
        self._sides: Final = (_Side * len(things.outlines))()
        self._view: Final = _View(
            dimensions.CAMERA_AHEAD, dimensions.CAMERA_HEIGHT, dimensions.WALL_HEIGHT, NEAREST,
            scene.arena.width_cm, scene.arena.height_cm, scene.camera.range_cm, self.lens.widest, traits.yaw,
            own, scene.robots.count, len(things.things), scene.is_furnished,
            self.leds.ctypes.data if scene.camera.sees_leds else None, things.lamps, len(things.lamps), *things.kinds,
            dimensions.LED_COS,
            _Disc(0.0, 0.0, dimensions.ROBOT_RADIUS, dimensions.ROBOT_HEIGHT, ROBOT), things.things,
            things.fixed, len(things.fixed), things.outlines, len(things.outlines),
            things.patches, len(things.patches), self._discs, 0, self._sides, 0,
        )  # fmt: skip
        self._address: Final = addressof(self._view)
        self._counts = scene.robots.count, len(things.things)
        self._sensed: Final = things.sensed.ctypes.data
        self._fans: Final[dict[tuple[float, int], Fan]] = {}
        self._dark: Final = scene.camera.vignetting
        self._window: Fan | None = None

    def look(self, poses: Poses, before: Poses | None = None, quanta: float = 0.0) -> None:
        """Look at `poses` from the own one, extrapolated by `quanta` of the way it has come since `before`."""
        if poses.counts != self._counts:
            self._adapt(poses)
        address = poses.address
        self._collect(self._address, address, address if before is None else before.address, quanta)

    def _adapt(self, poses: Poses) -> None:
        """Fewer robots or objects than the scene has: tests, and moments of a record."""
        robots, objects = poses.counts
        if objects > len(self._things.things) or robots > len(self.leds):
            raise ValueError(f"{robots} robots and {objects} objects are more than the scene has")
        self._counts = poses.counts
        self._view.robots, self._view.objects = poses.counts

    def classes(self, v: int, columns: NDArray[np.intp]) -> NDArray[np.uint8]:
        """Classes of the pixels of one row in some columns, until the next call for that row."""
        fan = self._fan(v, columns)
        self._classes(self._address, fan.address)
        return fan.seen

    def line(self, poses: Poses, before: Poses, quanta: float, v: int, columns: NDArray[np.intp], colours: int,
             noise: int) -> NDArray[np.uint8]:  # fmt: skip
        """As `look`, then red, green and blue of the pixels of a row, until the next call for that row: `colours` is
        where 16-bit numbers for each class are, `noise` where those are that are added to one value after the other."""
        if poses.counts != self._counts:
            self._adapt(poses)
        fan = self._fans.get((v, id(columns))) or self._fan(v, columns)
        self._line(self._address, poses.address, before.address, quanta, fan.address, colours, noise)
        return fan.pixels

    def lend(self) -> tuple[int, int]:
        """For compiled code: where `line` of sight.c is, and `struct view`."""
        return address_of(self._line), self._address

    def fan(self, v: int, columns: NDArray[np.intp]) -> Fan:
        """What `line` paints a row with, for who calls it from compiled code; whoever does keeps it."""
        return self._fan(v, columns)

    def sensor(self) -> int:
        """OBJECT, ROBOT or NOTHING by the votes of the window's pixels with perfect colours (`vision.sensor_of`)."""
        if self._window is None:
            rays = [ray for u in WINDOW_COLUMNS for ray in self.lens.column(u, WINDOW_ROWS)]
            left, up = np.array(rays).T
            self._window = Fan(left, up)
        objects, robots = divmod(self._votes(self._address, self._window.address, self._sensed), 256)
        return OBJECT if objects >= VOTES else ROBOT if robots >= VOTES else NOTHING

    def _fan(self, v: int, columns: NDArray[np.intp]) -> Fan:
        """A camera asks for the same rows and columns again and again."""
        key = v, id(columns)
        fan = self._fans.get(key)
        if fan is None:
            if len(self._fans) >= ROWS_KEPT:
                self._fans.clear()
            bright = self.lens.vignetting(v, columns, self._dark) if self._dark else None
            fan = self._fans[key] = Fan(*self.lens.line(v, columns), columns, bright)
        return fan
