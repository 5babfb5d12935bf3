"""What a robot's camera sees: rays through pixel columns, with heights (epuck.md §7.6).

A ray through column u hits discs and a wall; a pixel's row says at which height it passes each of them. What is
nearest and tall enough is seen. `Eye.classes` answers for many columns of one row at once, `Eye.column` for one
column: two ways to the same answer, compared in the tests. Lengths cm; rows and columns are those of the upright
640 x 480 picture.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from arena import bodies
from arena.lens import Rays, lens_of
from arena.scene import Scene
from arena.world import Poses

NOTHING, OBJECT, ROBOT, WALL, FLOOR, ABOVE = range(6)
"""What a pixel shows; NOTHING is only an answer of the whole sensor, ABOVE is the room over the walls."""
NAMES: Final = ("nothing", "object", "robot", "wall", "floor", "above")

COLOURS: Final = np.array(
    [(100, 90, 90), (90, 14, 14), (10, 48, 14), (112, 100, 100), (100, 90, 88), (120, 110, 110)], dtype=np.uint8
)
"""As the sensor shows them in the light of the experiment: made to lie near the references of the firmware's
classifier, red (80,0,0), green (0,40,0), white (100,80,80) (openswarm-original.md §8). UNVERIFIED on a robot."""

_NEAREST: Final = 0.05
"""Depth of what touches the lens."""
_SURE: Final = 1e-9
"""More than rounding can make of a length or a slope."""
Disc = tuple[float, float, float, float, int]
"""Ahead and left of the camera, radius, height, class."""


class Eye:
    """One robot's view at one pose of everything. `own` is the index of the robot that looks, at (x, y, heading)."""

    def __init__(self, scene: Scene, poses: Poses, own: int, pose: tuple[float, float, float] | None = None) -> None:
        x, y, heading = pose if pose is not None else poses.robots[own]
        self._cos, self._sin = math.cos(heading), math.sin(heading)
        self._x = x + bodies.CAMERA_AHEAD * self._cos
        self._y = y + bodies.CAMERA_AHEAD * self._sin
        self._width, self._height = scene.arena.width_cm, scene.arena.height_cm
        self._range = scene.camera.range_cm
        self.lens = lens_of(scene.camera)
        self.discs: Final[list[Disc]] = []
        self._collect(poses.objects, scene.objects.radius_cm, bodies.OBJECT_HEIGHT, OBJECT)
        others = [(one[0], one[1]) for index, one in enumerate(poses.robots) if index != own]
        self._collect(others, bodies.ROBOT_RADIUS, bodies.ROBOT_HEIGHT, ROBOT)
        self.discs.sort()

    def _collect(self, places: list[tuple[float, float]], radius: float, height: float, kind: int) -> None:
        """Keep what the picture's widest ray can touch within range."""
        cos, sin, own_x, own_y = self._cos, self._sin, self._x, self._y
        limit = self._range + radius
        widest = self.lens.widest
        for x, y in places:
            dx, dy = x - own_x, y - own_y
            ahead = dx * cos + dy * sin
            if -radius < ahead < limit:
                left = dy * cos - dx * sin
                if abs(left) - 1.2 * radius < widest * (ahead + radius):  # 1.2: the ray's slope to the rim
                    self.discs.append((ahead, left, radius, height, kind))

    def hits(self, slope: float, discs: list[Disc] | None = None) -> list[tuple[float, float, int]]:
        """(depth, height, class) of the discs a ray meets, nearest first; slope = left per ahead."""
        found = []
        a = 1 + slope * slope
        reach = self._range / math.sqrt(a)
        for ahead, left, radius, height, kind in self.discs if discs is None else discs:
            b = ahead + slope * left
            c = ahead * ahead + left * left - radius * radius
            root = b * b - a * c
            if root <= 0 or b <= 0:
                continue
            depth = max((b - math.sqrt(root)) / a, _NEAREST)
            if depth <= reach:
                found.append((depth, height, kind))
        found.sort()
        return found

    def wall_depth(self, slope: float) -> float:
        """Depth at which a ray meets a wall."""
        east = self._cos - slope * self._sin
        north = self._sin + slope * self._cos
        to_x = (self._width - self._x) / east if east > 0 else -self._x / east if east < 0 else math.inf
        to_y = (self._height - self._y) / north if north > 0 else -self._y / north if north < 0 else math.inf
        return max(min(to_x, to_y), _NEAREST)

    def column(self, u: float, rows: tuple[int, ...], discs: list[Disc] | None = None) -> list[int]:
        """Classes of the pixels of one column in some rows."""
        slope, wall = math.nan, -1.0
        hits: list[tuple[float, float, int]] = []
        seen = []
        for ray, rise in self.lens.column(u, rows):
            if ray != slope:
                slope, wall = ray, -1.0
                hits = self.hits(slope, discs)
            for depth, height, kind in hits:
                z = bodies.CAMERA_HEIGHT + rise * depth
                if z < 0:
                    seen.append(FLOOR)
                    break
                if z <= height:
                    seen.append(kind)
                    break
            else:
                if wall < 0:
                    wall = self.wall_depth(slope)
                z = bodies.CAMERA_HEIGHT + rise * wall
                seen.append(FLOOR if z < 0 else WALL if z <= bodies.WALL_HEIGHT else ABOVE)
        return seen

    def within(self, right: float, left: float) -> list[Disc]:
        """The discs that rays with slopes right..left can meet: a quick, generous choice."""
        return [
            disc
            for disc in self.discs
            if disc[1] - 1.1 * disc[2] <= left * disc[0] and disc[1] + 1.1 * disc[2] >= right * disc[0]
        ]

    def classes(self, v: int, columns: NDArray[np.intp]) -> NDArray[np.intp] | int:
        """Classes of the pixels of one row in some columns; one number if all are the same."""
        rays = self.lens.row(v, columns)
        seen = self._background(rays)
        discs = [disc for disc in self.within(rays.right_most, rays.left_most) if _matters(disc, rays)]
        if len(discs) == 1 and _is_plain(discs[0], rays, self._range):
            ahead, left, radius, _, kind = discs[0]
            b = ahead + rays.left * left
            return np.where(b * b > rays.length2 * (ahead * ahead + left * left - radius * radius), kind, seen)
        return self._with(discs, rays, seen) if discs else seen

    def _with(self, discs: list[Disc], rays: Rays, background: NDArray[np.intp] | int) -> NDArray[np.intp]:
        """Classes with discs in any order at any distance."""
        slopes, rise, a = rays.left, rays.up, rays.length2
        seen = np.full(len(slopes), background) if isinstance(background, int) else background
        blocked: Any = math.inf
        for ahead, left, radius, height, kind in discs:
            b = ahead + slopes * left
            root = b * b - a * (ahead * ahead + left * left - radius * radius)
            meets = root > 0
            depth = np.maximum((b - np.sqrt(np.maximum(root, 0.0))) / a, _NEAREST)
            z = bodies.CAMERA_HEIGHT + rise * depth
            shows = meets & (b > 0) & (depth * rays.length <= self._range) & (z <= height) & (depth < blocked)
            seen[shows] = np.where(z < 0, FLOOR, kind)[shows]
            blocked = np.where(shows, depth, blocked)
        return seen

    def _background(self, rays: Rays) -> NDArray[np.intp] | int:
        """Classes without discs. Most rows show nothing but wall, or nothing but floor: two rays then tell it."""
        walls = self._walls()
        right = [across + along * rays.right_most for across, along in walls]
        left = [across + along * rays.left_most for across, along in walls]
        least = min(max(map(min, right, left)), 1 / _NEAREST)  # closeness to a wall is convex in the slope
        most = min(max(*right, *left), 1 / _NEAREST)
        over = bodies.WALL_HEIGHT - bodies.CAMERA_HEIGHT
        if rays.lowest > -bodies.CAMERA_HEIGHT * least + _SURE and rays.highest < over * least - _SURE:
            return WALL
        if rays.highest < -bodies.CAMERA_HEIGHT * most - _SURE:
            return FLOOR
        near = np.minimum((np.array(walls) @ rays.basis).max(axis=0), 1 / _NEAREST)
        seen = np.where(rays.up < -bodies.CAMERA_HEIGHT * near, FLOOR, WALL)
        seen[rays.up > over * near] = ABOVE
        return seen

    def _walls(self) -> list[tuple[float, float]]:
        """1 / depth at which rays meet each wall, as (a, b) in a + b slope. The largest of the four counts."""
        cos, sin = self._cos, self._sin
        right, top = 1 / max(self._width - self._x, _NEAREST), 1 / max(self._height - self._y, _NEAREST)
        lower, bottom = -1 / max(self._x, _NEAREST), -1 / max(self._y, _NEAREST)
        return [
            (cos * right, -sin * right),
            (cos * lower, -sin * lower),
            (sin * top, cos * top),
            (sin * bottom, cos * bottom),
        ]


def _heights(disc: Disc, rays: Rays) -> tuple[float, float]:
    """Between which heights all rays are where they may meet a disc."""
    near, far = max(disc[0] - disc[2], _NEAREST), max(disc[0] + disc[2], _NEAREST)
    low, high = min(rays.lowest * near, rays.lowest * far), max(rays.highest * near, rays.highest * far)
    return bodies.CAMERA_HEIGHT + low, bodies.CAMERA_HEIGHT + high


def _matters(disc: Disc, rays: Rays) -> bool:
    """False if all rays pass over a disc, or all meet the floor before it."""
    low, high = _heights(disc, rays)
    return low <= disc[3] + _SURE and high >= -_SURE


def _is_plain(disc: Disc, rays: Rays, sight: float) -> bool:
    """Whether every ray that is not led past a disc's side shows it: ahead, within sight, neither over nor under it."""
    ahead, _, radius, height, _ = disc
    low, high = _heights(disc, rays)
    seen = ahead > radius + _NEAREST and (ahead + radius) * rays.longest < sight - _SURE
    return seen and low > _SURE and high < height - _SURE


# -- the sensor of the clustering firmware (openswarm-original.md §8, revision A) ------------------------------------

WINDOW_COLUMNS: Final = tuple(240 + 8 * x for x in (6, 9, 12, 15))
WINDOW_EDGES: Final = (WINDOW_COLUMNS[0], WINDOW_COLUMNS[-1])
WINDOW_ROWS: Final = tuple(160 + 8 * y for y in (4, 6, 8, 10, 12, 14))
"""Its 24 pixels in the whole picture: every 8th pixel of the 160 x 160 in the middle."""
VOTES: Final = 2


def sensor_of(eye: Eye) -> int:
    """OBJECT, ROBOT or NOTHING by the votes of 24 pixels with perfect colours."""
    edges = [ray for u in WINDOW_EDGES for ray, _ in eye.lens.column(u, WINDOW_ROWS)]
    discs = eye.within(min(edges), max(edges))
    if not discs:
        return NOTHING
    red = green = 0
    for u in WINDOW_COLUMNS:
        seen = eye.column(u, WINDOW_ROWS, discs)
        red += seen.count(OBJECT)
        green += seen.count(ROBOT)
    return OBJECT if red >= VOTES else ROBOT if green >= VOTES else NOTHING
