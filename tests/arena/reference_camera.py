"""Reference implementation of the camera: rays through pixel columns, with heights (epuck.md §7.6).

A ray through column u hits discs and a wall. The row of a pixel gives the height at which the ray passes each of them.
The nearest body that is tall enough is visible. The tests compare this slow version with arena/camera/renderer.c.
Lengths cm; rows and columns are those of the upright 640 x 480 picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from arena.camera.appearance import (
    ABOVE,
    FLOOR,
    LED_POSITIONS,
    NOTHING,
    OBJECT,
    ROBOT,
    WALL,
    Appearance,
    appearance_of,
    led_classes,
)
from arena.camera.lens import lens_of
from arena.camera.line_of_sight import VOTES, WINDOW_COLUMNS, WINDOW_ROWS
from arena.camera.view import NEAREST
from arena.scene import dimensions, geometry
from arena.scene.loader import Scene
from arena.scene.robot_kind import Traits
from arena.world.poses import Poses

Disc = tuple[float, float, float, float, int]
"""Disc in the camera frame: centre ahead and left of the camera, radius, height, class."""


Side = tuple[float, float, float, float, float, int, float]
"""Side in the camera frame: ahead and left of both ends, height, class, greatest distance at which it is visible."""


class ReferenceCamera:
    """Camera of robot `own` at given poses of all bodies.

    `pose` replaces its own pose (x, y, heading). `traits` are the deviations of its mounting, `leds` the lit LEDs of
    each robot as in a record.
    """

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
        self._width, self._height = scene.arena.extent
        self._range = scene.camera.range_cm
        self.lens = lens_of(scene.camera, traits.pitch_deg)
        self.discs: Final[list[Disc]] = []
        self._appearance = appearance = appearance_of(scene) if scene.is_furnished else None
        if appearance is None:
            self._collect(poses.objects, scene.objects.radius_cm, dimensions.OBJECT_HEIGHT, OBJECT)
        else:
            for place, (radius, height, kind) in zip(poses.objects, appearance.objects, strict=True):
                if radius:
                    self._collect([place], radius, height, kind)
        self._sides = self._visible_sides(appearance, poses) if appearance is not None else []
        self._robot = appearance.robot if appearance is not None else ROBOT
        for index, (x, y, _) in enumerate(poses.robots):
            if index != own:
                body = scene.robot_kind(index)
                self._collect([(x, y)], body.radius_cm, body.height_cm, self._robot)
        self.discs.sort()
        self._lit = [
            (*self._in_camera_frame(x, y), turned - heading - traits.yaw, lit)
            for index, ((x, y, turned), lit) in enumerate(zip(poses.robots, leds, strict=False))
            if lit and index != own
        ]
        self._led_class, self._body_class = led_classes(scene)

    @property
    def sensor_classes(self) -> list[int] | None:
        """Class that the line-of-sight sensor reports for each class; None if all are reported as they are."""
        return self._appearance.sensor_classes if self._appearance is not None else None

    def _collect(self, places: list[tuple[float, float]], radius: float, height: float, kind: int) -> None:
        """Collect the discs that a ray of the picture can hit within range."""
        cos, sin, own_x, own_y = self._cos, self._sin, self._x, self._y
        limit = self._range + radius
        widest = self.lens.widest
        for x, y in places:
            dx, dy = x - own_x, y - own_y
            ahead = dx * cos + dy * sin
            if -radius < ahead < limit:
                left = dy * cos - dx * sin
                if abs(left) - 1.2 * radius < widest * (ahead + radius):  # 1.2: slope of the ray to the rim
                    self.discs.append((ahead, left, radius, height, kind))

    def _visible_sides(self, appearance: Appearance, poses: Poses) -> list[Side]:
        """Return the sides of walls, obstacles and movable polygons in the camera frame."""
        cos, sin, found = self._cos, self._sin, []
        sides = [(*one, math.inf) for one in appearance.sides]
        for (number, corners, height, kind), heading in zip(appearance.polygons, poses.headings, strict=True):
            outline = geometry.sides(geometry.turned(corners, *poses.objects[number], heading))
            sides += [(side, height, kind, self._range) for side in outline]
        for (x1, y1, x2, y2), height, kind, reach in sides:
            x1, y1, x2, y2 = x1 - self._x, y1 - self._y, x2 - self._x, y2 - self._y
            ends = x1 * cos + y1 * sin, y1 * cos - x1 * sin, x2 * cos + y2 * sin, y2 * cos - x2 * sin
            if ends[0] > 0 or ends[2] > 0:
                found.append((*ends, height, kind, reach))
        return found

    def hits(self, slope: float, discs: list[Disc] | None = None) -> list[tuple[float, float, int]]:
        """Return (depth, height, class) of the bodies that a ray hits, nearest first. `slope`: distance to the left
        per distance ahead."""
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
        for ax, ay, bx, by, height, kind, farthest in self._sides:
            across = (by - ay) - slope * (bx - ax)
            if across:
                depth, part = (ax * (by - ay) - ay * (bx - ax)) / across, (ax * slope - ay) / across
                if depth > 0 and 0 <= part <= 1 and depth <= farthest / math.sqrt(a):
                    found.append((max(depth, NEAREST), height, kind))
        if self._appearance is not None:
            found += self._fixed_hits(slope)
        found.sort()
        return found

    def _fixed_hits(self, slope: float) -> list[tuple[float, float, int]]:
        """Return depth, height and class of the round obstacles that a ray hits. Like walls, they are visible at any
        distance."""
        assert self._appearance is not None
        found = []
        a = 1 + slope * slope
        for x, y, radius, height, kind in self._appearance.discs:
            ahead, left = self._in_camera_frame(x, y)
            b, c = ahead + slope * left, ahead * ahead + left * left - radius * radius
            root = b * b - a * c
            if root > 0 and b > 0:
                found.append((max((b - math.sqrt(root)) / a, NEAREST), height, kind))
        return found

    def _in_camera_frame(self, x: float, y: float) -> tuple[float, float]:
        """Return a point in the camera frame as (ahead, left)."""
        dx, dy = x - self._x, y - self._y
        return dx * self._cos + dy * self._sin, dy * self._cos - dx * self._sin

    def _floor(self, ray: float, rise: float) -> int:
        """Return the class of the floor at the point at which a ray hits it."""
        if self._appearance is None or not self._appearance.patches:
            return FLOOR
        depth = -dimensions.CAMERA_HEIGHT / rise
        x = self._x + depth * (self._cos - ray * self._sin)
        y = self._y + depth * (self._sin + ray * self._cos)
        return self._appearance.floor_at(x, y)

    def wall_depth(self, slope: float) -> float:
        """Return the depth at which a ray hits a wall; infinite without walls."""
        if math.isinf(self._width):
            return math.inf
        east = self._cos - slope * self._sin
        north = self._sin + slope * self._cos
        to_x = (self._width - self._x) / east if east > 0 else -self._x / east if east < 0 else math.inf
        to_y = (self._height - self._y) / north if north > 0 else -self._y / north if north < 0 else math.inf
        return max(min(to_x, to_y), NEAREST)

    def column(self, u: float, rows: tuple[int, ...], discs: list[Disc] | None = None) -> list[int]:
        """Return the pixel classes of one column in some rows."""
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
                    is_robot = kind == self._robot and bool(self._lit)
                    seen.append(self._robot_class(depth, slope * depth, z) if is_robot else kind)
                    break
            else:
                if wall < 0:
                    wall = self.wall_depth(slope)
                z = dimensions.CAMERA_HEIGHT + rise * wall
                kind = WALL if z <= dimensions.WALL_HEIGHT else ABOVE
                seen.append(self._floor(ray, rise) if z < 0 else kind)
        return seen

    def _robot_class(self, ahead: float, left: float, z: float) -> int:
        """Return the class of a point on a robot's edge."""
        for x, y, heading, lit in self._lit:
            forward = (ahead - x) * math.cos(heading) + (left - y) * math.sin(heading)
            aside = (left - y) * math.cos(heading) - (ahead - x) * math.sin(heading)
            if math.hypot(forward, aside) > 1.001 * dimensions.ROBOT_RADIUS:
                continue  # the edge of another robot
            for led, (to_front, to_left, low, high) in enumerate(LED_POSITIONS):
                near = forward * to_front + aside * to_left >= dimensions.ROBOT_RADIUS * dimensions.LED_COS
                if lit >> led & 1 and near and low <= z <= high:
                    return self._led_class
            return self._body_class if lit >> len(LED_POSITIONS) & 1 else self._robot
        return self._robot

    def within(self, right: float, left: float) -> list[Disc]:
        """Return the discs that rays with slopes `right` to `left` can hit, and possibly some others."""
        return [
            disc
            for disc in self.discs
            if disc[1] - 1.1 * disc[2] <= left * disc[0] and disc[1] + 1.1 * disc[2] >= right * disc[0]
        ]


def sensor_of(camera: ReferenceCamera) -> int:
    """Return OBJECT, ROBOT or NOTHING by the votes of 24 pixels with exact colours."""
    edges = [ray for u in (WINDOW_COLUMNS[0], WINDOW_COLUMNS[-1]) for ray, _ in camera.lens.column(u, WINDOW_ROWS)]
    discs = camera.within(min(edges), max(edges))
    sensor_classes = camera.sensor_classes
    if not discs and sensor_classes is None:
        return NOTHING
    red = green = 0
    for u in WINDOW_COLUMNS:
        seen = camera.column(u, WINDOW_ROWS, discs)
        if sensor_classes is not None:
            seen = [sensor_classes[one] for one in seen]
        red += seen.count(OBJECT)
        green += seen.count(ROBOT)
    return OBJECT if red >= VOTES else ROBOT if green >= VOTES else NOTHING
