"""What a robot's camera sees: rays through pixel columns, with heights (epuck.md §7.6).

A ray through column u hits discs and a wall; a pixel's row says at which height it passes each of them. What is
nearest and tall enough is seen. This is the plain text of it, one column at a time; trials ask `sight.py`, which is
compiled, and the tests compare the two. Lengths cm; rows and columns are those of the upright 640 x 480 picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from arena.camera.appearance import ABOVE, FLOOR, LAMPS, NOTHING, OBJECT, ROBOT, WALL, Look, led_kinds, look_of
from arena.camera.lens import lens_of
from arena.scene import dimensions
from arena.scene.loader import Scene
from arena.world.physics import Poses, Traits

NEAREST: Final = 0.05
"""Depth of what touches the lens."""
Disc = tuple[float, float, float, float, int]
"""Ahead and left of the camera, radius, height, class."""


class Eye:
    """One robot's view at one pose of everything. `own` is the index of the robot that looks, at (x, y, heading);
    `traits` say how its camera is mounted; `leds` what is lit on each robot, as in a record."""

    def __init__(
        self,
        scene: Scene,
        poses: Poses,
        own: int,
        pose: tuple[float, float, float] | None = None,
        traits: Traits = Traits(),  # noqa: B008 - never changes
        leds: Sequence[int] = (),
    ) -> None:
        x, y, heading = pose if pose is not None else poses.robots[own]
        self._cos, self._sin = math.cos(heading), math.sin(heading)
        self._x = x + dimensions.CAMERA_AHEAD * self._cos
        self._y = y + dimensions.CAMERA_AHEAD * self._sin
        if traits.yaw:
            self._cos, self._sin = math.cos(heading + traits.yaw), math.sin(heading + traits.yaw)
        self._width, self._height = scene.arena.width_cm, scene.arena.height_cm
        self._range = scene.camera.range_cm
        self.lens = lens_of(scene.camera, traits.pitch_deg)
        self.discs: Final[list[Disc]] = []
        self._look = look = look_of(scene) if scene.is_furnished else None
        if look is None:
            self._collect(poses.objects, scene.objects.radius_cm, dimensions.OBJECT_HEIGHT, OBJECT)
        else:
            for place, (radius, height, kind) in zip(poses.objects, look.objects, strict=True):
                self._collect([place], radius, height, kind)
        self._sides = self._turned(look) if look is not None else []
        others = [(one[0], one[1]) for index, one in enumerate(poses.robots) if index != own]
        self._collect(others, dimensions.ROBOT_RADIUS, dimensions.ROBOT_HEIGHT, ROBOT)
        self.discs.sort()
        self._lit = [(*self._seen_from(*poses.robots[index][:2]), poses.robots[index][2] - heading - traits.yaw, lit)
                     for index, lit in enumerate(leds) if lit and index != own]  # fmt: skip
        self._led_kind, self._body_kind = led_kinds(scene)

    @property
    def sensed(self) -> list[int] | None:
        """What the clustering sensor takes each class for; None where classes are what they are."""
        return self._look.sensed if self._look is not None else None

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

    def _turned(self, look: Look) -> list[tuple[float, float, float, float, float, int]]:
        """Sides of walls and obstacles as the camera sees them: ahead and left of both ends, height, class."""
        cos, sin, found = self._cos, self._sin, []
        for (x1, y1, x2, y2), height, kind in look.sides:
            x1, y1, x2, y2 = x1 - self._x, y1 - self._y, x2 - self._x, y2 - self._y
            ends = x1 * cos + y1 * sin, y1 * cos - x1 * sin, x2 * cos + y2 * sin, y2 * cos - x2 * sin
            if ends[0] > 0 or ends[2] > 0:
                found.append((*ends, height, kind))
        return found

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
            depth = max((b - math.sqrt(root)) / a, NEAREST)
            if depth <= reach:
                found.append((depth, height, kind))
        for ax, ay, bx, by, height, kind in self._sides:
            across = (by - ay) - slope * (bx - ax)
            if across:
                depth, part = (ax * (by - ay) - ay * (bx - ax)) / across, (ax * slope - ay) / across
                if depth > 0 and 0 <= part <= 1:
                    found.append((max(depth, NEAREST), height, kind))
        if self._look is not None:
            found += self._fixed(slope)
        found.sort()
        return found

    def _fixed(self, slope: float) -> list[tuple[float, float, int]]:
        """Depth, height and class of the round obstacles a ray meets, at any distance, as walls are."""
        assert self._look is not None
        found = []
        a = 1 + slope * slope
        for x, y, radius, height, kind in self._look.discs:
            ahead, left = self._seen_from(x, y)
            b, c = ahead + slope * left, ahead * ahead + left * left - radius * radius
            root = b * b - a * c
            if root > 0 and b > 0:
                found.append((max((b - math.sqrt(root)) / a, NEAREST), height, kind))
        return found

    def _seen_from(self, x: float, y: float) -> tuple[float, float]:
        """A place as (ahead, left) of the camera."""
        dx, dy = x - self._x, y - self._y
        return dx * self._cos + dy * self._sin, dy * self._cos - dx * self._sin

    def _floor(self, ray: float, rise: float) -> int:
        """Class of the floor a ray meets."""
        if self._look is None or not self._look.patches:
            return FLOOR
        depth = -dimensions.CAMERA_HEIGHT / rise
        x = self._x + depth * (self._cos - ray * self._sin)
        y = self._y + depth * (self._sin + ray * self._cos)
        return self._look.floor_at(x, y)

    def wall_depth(self, slope: float) -> float:
        """Depth at which a ray meets a wall."""
        east = self._cos - slope * self._sin
        north = self._sin + slope * self._cos
        to_x = (self._width - self._x) / east if east > 0 else -self._x / east if east < 0 else math.inf
        to_y = (self._height - self._y) / north if north > 0 else -self._y / north if north < 0 else math.inf
        return max(min(to_x, to_y), NEAREST)

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
                z = dimensions.CAMERA_HEIGHT + rise * depth
                if z < 0:
                    seen.append(self._floor(ray, rise))
                    break
                if z <= height:
                    seen.append(self._glow(depth, slope * depth, z) if kind == ROBOT and self._lit else kind)
                    break
            else:
                if wall < 0:
                    wall = self.wall_depth(slope)
                z = dimensions.CAMERA_HEIGHT + rise * wall
                kind = WALL if z <= dimensions.WALL_HEIGHT else ABOVE
                seen.append(self._floor(ray, rise) if z < 0 else kind)
        return seen

    def _glow(self, ahead: float, left: float, z: float) -> int:
        """Class of a place on a robot's edge."""
        for x, y, heading, lit in self._lit:
            forward = (ahead - x) * math.cos(heading) + (left - y) * math.sin(heading)
            aside = (left - y) * math.cos(heading) - (ahead - x) * math.sin(heading)
            if math.hypot(forward, aside) > 1.001 * dimensions.ROBOT_RADIUS:
                continue  # another robot's
            for led, (to_front, to_left, low, high) in enumerate(LAMPS):
                near = forward * to_front + aside * to_left >= dimensions.ROBOT_RADIUS * dimensions.LED_COS
                if lit >> led & 1 and near and low <= z <= high:
                    return self._led_kind
            return self._body_kind if lit >> len(LAMPS) & 1 else ROBOT
        return ROBOT

    def within(self, right: float, left: float) -> list[Disc]:
        """The discs that rays with slopes right..left can meet: a quick, generous choice."""
        return [
            disc
            for disc in self.discs
            if disc[1] - 1.1 * disc[2] <= left * disc[0] and disc[1] + 1.1 * disc[2] >= right * disc[0]
        ]


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
    sensed = eye.sensed
    if not discs and sensed is None:
        return NOTHING
    red = green = 0
    for u in WINDOW_COLUMNS:
        seen = eye.column(u, WINDOW_ROWS, discs)
        if sensed is not None:
            seen = [sensed[one] for one in seen]
        red += seen.count(OBJECT)
        green += seen.count(ROBOT)
    return OBJECT if red >= VOTES else ROBOT if green >= VOTES else NOTHING
