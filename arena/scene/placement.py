"""Start positions: on marks of a grid, as listed in the scene, or random (epuck.md §8)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Final

import numpy as np

from arena.scene import geometry
from arena.scene.loader import Scene, SceneError
from arena.scene.robot_kind import EPUCK, KINDS
from arena.scene.schema import ObjectKind, Placed, RobotGroup

Place = tuple[float, ...]
"""Position x, y in cm; of a movable polygon also its heading in rad."""
ROUNDING_CM: Final = 1e-9
"""Tolerance for rounding errors of distances: bodies may touch, as on a lattice with gaps of their diameter."""
OVERLAP_CM: Final = 0.5
"""Accepted overlap of bodies with poses in [start]. Bodies that robots push together overlap by about 0.1 cm."""
TRIES: Final = 2000
"""Random positions to try before the scene counts as full."""


def marks_of(scene: Scene) -> list[Place]:
    """Return the marks within the walls in cm from the lower left corner, row by row."""
    grid, arena = scene.marks, scene.arena
    left = (arena.width_cm - (grid.columns - 1) * grid.spacing_cm) / 2
    low = (arena.height_cm - (grid.rows - 1) * grid.spacing_cm) / 2
    places = ((left + c * grid.spacing_cm, low + r * grid.spacing_cm) for r in range(grid.rows)
              for c in range(grid.columns))  # fmt: skip
    return [(x, y) for x, y in places if 0 < x < arena.width_cm and 0 < y < arena.height_cm]


@cache
def hexagonal(count: int, spacing: float) -> list[Place]:
    """Return the `count` points of a hexagonal lattice nearest to its origin, sorted by distance, then by angle."""
    reach = math.ceil(math.sqrt(count)) + 1
    points: list[Place] = [(spacing * (column + row % 2 / 2), spacing * row * math.sqrt(3) / 2)
              for row in range(-reach, reach + 1) for column in range(-reach, reach + 1)]  # fmt: skip
    return sorted(points, key=lambda at: (round(math.hypot(*at), 6), round(math.atan2(at[1], at[0]), 6)))[:count]


def place_all(scene: Scene, rng: np.random.Generator) -> tuple[list[tuple[float, float, float]], list[Place]]:
    """Return the poses of the robots (x, y in cm, heading in rad) and the positions of the objects, without contacts.

    Poses in [start] are returned as they are, with contacts. Raises SceneError if there is no room: too few marks,
    marks too near each other or to a wall, or bodies in [start] that overlap.
    """
    if scene.start.robot_poses or scene.start.object_poses:
        return _start_poses(scene)
    if scene.groups or scene.kinds or scene.is_furnished:
        return _Placer(scene, rng).place()
    radii = [EPUCK.radius_cm] * scene.robots.count + [scene.objects.radius_cm] * scene.objects.count
    marks = marks_of(scene)
    if len(radii) > len(marks):
        raise SceneError(f"{scene.name}: no room: {len(radii)} robots and objects on {len(marks)} marks")
    chosen = [marks[index] for index in rng.permutation(len(marks))[: len(radii)]]
    placed = _PlacedDiscs(max(radii, default=0.0))
    for (x, y), radius in zip(chosen, radii, strict=True):
        nearest = min(x, y, scene.arena.width_cm - x, scene.arena.height_cm - y)
        if nearest < radius and scene.arena.walls:
            where = f"the mark at ({x:g}, {y:g}) cm is nearer to a wall than {radius:g} cm"
            raise SceneError(f"{scene.name}: no room: {where}")
        for other_x, other_y, other in placed.near(x, y):
            if math.hypot(x - other_x, y - other_y) < radius + other:
                raise SceneError(f"{scene.name}: no room: marks are {scene.marks.spacing_cm:g} cm apart")
        placed.add(x, y, radius)
    headings = rng.uniform(-math.pi, math.pi, scene.robots.count).tolist()
    robots = [(x, y, angle) for (x, y), angle in zip(chosen, headings, strict=False)]
    return robots, chosen[scene.robots.count :]


def _start_poses(scene: Scene) -> tuple[list[tuple[float, float, float]], list[Place]]:
    """Return the poses of robots and objects in [start]. Raises SceneError for a body in a wall or in another body."""
    robots = [(x, y, math.radians(degrees)) for x, y, degrees in scene.start.robot_poses]
    objects: list[Place] = [(*pose[:2], *map(math.radians, pose[2:])) for pose in scene.start.object_poses]
    outlines = outlines_of(scene)
    taken: list[tuple[float, float, float]] = []
    shapes: list[tuple[Place, list[tuple[float, float]]]] = []
    bodies: list[tuple[str, Place, float]] = [
        ("robot_poses", place, scene.robot_kind(number).radius_cm) for number, place in enumerate(robots)
    ]
    for number, place in enumerate(objects):
        kind = scene.kind_of(number)
        if kind.polygon:
            shapes.append((place, geometry.turned(geometry.centred(kind.polygon), *place)))
        else:
            bodies.append(("object_poses", place, kind.radius_cm))
    for key, (x, y, *_), radius in bodies:
        reach = max(radius - OVERLAP_CM, 0.0)
        why = obstruction(scene, outlines, taken, x, y, reach)
        for place, shape in shapes:
            if not why and (geometry.contains(shape, x, y) or _distance_to(shape, x, y) < reach):
                why = f"touches what is at ({place[0]:g}, {place[1]:g}) cm"
        _refuse(scene, key, (x, y), why)
        taken.append((x, y, radius))
    for index, (place, shape) in enumerate(shapes):
        others = [(at, other) for number, (at, other) in enumerate(shapes) if number != index]
        for corner in shape:
            x, y = _shifted(corner, place)
            touched = [at for at, other in others if geometry.contains(other, x, y)]
            why = f"touches what is at ({touched[0][0]:g}, {touched[0][1]:g}) cm" if touched else ""
            _refuse(scene, "object_poses", place, why or obstruction(scene, outlines, [], x, y, 0.0))
    return robots, objects


def _refuse(scene: Scene, key: str, place: Place, why: str) -> None:
    """Raise SceneError for a pose in [start], unless `why` is empty."""
    if why:
        raise SceneError(f"{scene.name}: start.{key}: ({place[0]:g}, {place[1]:g}) cm {why}")


def _distance_to(shape: list[tuple[float, float]], x: float, y: float) -> float:
    """Return the distance from a point to the nearest side of a polygon."""
    return min(geometry.distance_to(x, y, side) for side in geometry.sides(shape))


def _shifted(corner: tuple[float, float], centre: Place) -> tuple[float, float]:
    """Return a corner of a polygon, moved by OVERLAP_CM towards its centre."""
    dx, dy = centre[0] - corner[0], centre[1] - corner[1]
    share = min(OVERLAP_CM / math.hypot(dx, dy), 1.0)
    return corner[0] + share * dx, corner[1] + share * dy


def outlines_of(scene: Scene) -> list[geometry.Side]:
    """Return the sides of the room and of its polygonal obstacles."""
    shapes = [scene.arena.polygon, *(one.polygon for one in scene.obstacles)]
    return [side for shape in shapes if shape for side in geometry.sides(shape)]


def obstruction(
    scene: Scene, outlines: Iterable[geometry.Side], taken: Iterable[tuple[float, float, float]], x: float, y: float,
    radius: float,
) -> str:  # fmt: skip
    """Return what obstructs a disc at a position, or an empty text.

    `outlines` are those of the scene; `taken` are other discs: x, y, radius. A movable polygon counts as its
    circumscribed circle."""
    arena = scene.arena
    if arena.walls and not (0 < x < arena.width_cm and 0 < y < arena.height_cm):
        return "is outside the walls"
    if arena.walls and min(x, y, arena.width_cm - x, arena.height_cm - y) < radius:
        return "is in a wall"
    if arena.polygon and not geometry.contains(arena.polygon, x, y):
        return "is outside the walls"
    if any(geometry.distance_to(x, y, side) < radius for side in outlines):
        return "touches a wall or an obstacle"
    for one in scene.obstacles:
        if one.polygon and geometry.contains(one.polygon, x, y):
            return f"is inside obstacle {one.name}".rstrip()
        if one.radius_cm and math.hypot(x - one.x_cm, y - one.y_cm) < radius + one.radius_cm:
            return f"touches obstacle {one.name}".rstrip()
    for other_x, other_y, other in taken:
        if math.hypot(x - other_x, y - other_y) < radius + other - ROUNDING_CM:
            return f"touches what is at ({other_x:g}, {other_y:g}) cm"
    return ""


class _PlacedDiscs:
    """Discs of at most a given radius by the cells of a grid: a disc can only touch discs of the cells around it."""

    def __init__(self, radius: float) -> None:
        self._side = 2 * radius or 1.0
        self._cells: dict[tuple[int, int], list[tuple[float, float, float]]] = {}

    def add(self, x: float, y: float, radius: float) -> None:
        """Add a disc."""
        self._cells.setdefault((math.floor(x / self._side), math.floor(y / self._side)), []).append((x, y, radius))

    def near(self, x: float, y: float) -> Iterator[tuple[float, float, float]]:
        """Yield x, y and radius of all discs that a disc at a position can touch, and possibly of some others."""
        column, row = math.floor(x / self._side), math.floor(y / self._side)
        for cell in product((column - 1, column, column + 1), (row - 1, row, row + 1)):
            yield from self._cells.get(cell, ())


class _Placer:
    """Places bodies one after the other: first those with listed poses, then the others, group by group."""

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        self._scene = scene
        self._rng = rng
        self._marks: Iterator[Place] = iter([])
        self._outlines = outlines_of(scene)
        radii = [KINDS[one.kind].radius_cm for one in scene.groups or (RobotGroup(),)]
        self._placed = _PlacedDiscs(max(radii + [one.radius_cm for one in scene.kinds or (scene.kind_of(0),)]))

    def place(self) -> tuple[list[tuple[float, float, float]], list[Place]]:
        """Return the poses of all robots and the positions of all objects."""
        scene = self._scene
        groups = scene.groups or (RobotGroup(count=scene.robots.count),)
        kinds = scene.kinds or (replace(scene.kind_of(0), count=scene.objects.count),)
        marks = marks_of(scene)
        self._marks = iter([marks[index] for index in self._rng.permutation(len(marks))])
        wanted: list[tuple[Placed, str, float]] = [(one, "robot", KINDS[one.kind].radius_cm) for one in groups]
        wanted += [(one, "object", one.radius_cm) for one in kinds]
        found: dict[int, list[tuple[float, ...]]] = {}
        for number in sorted(range(len(wanted)), key=lambda number: wanted[number][0].place != "poses"):
            found[number] = [self._place_one(*wanted[number], index) for index in range(wanted[number][0].count)]
        robots: list[tuple[float, float, float]] = []
        for number, group in enumerate(groups):
            robots += [(place[0], place[1], self._heading(group, place)) for place in found[number]]
        objects: list[Place] = []
        for number, kind in enumerate(kinds, start=len(groups)):
            for place in found[number]:
                objects.append((place[0], place[1], *((self._heading(kind, place),) if kind.polygon else ())))
        return robots, objects

    def _heading(self, one: RobotGroup | ObjectKind, place: Place) -> float:
        """Return the heading of a body in rad: as listed, that of its table, or random."""
        degrees = place[2] if len(place) == 3 else one.heading_deg
        drawn = float(self._rng.uniform(-math.pi, math.pi))
        return drawn if math.isnan(degrees) else math.radians(degrees)

    def _place_one(self, one: Placed, what: str, radius: float, index: int) -> tuple[float, ...]:
        """Return the pose of body `index` of a group and mark it as taken. Raises SceneError without room."""
        if one.place == "poses":
            pose = one.poses[index]
            why = self._obstruction(pose[0], pose[1], radius)
            if why:
                raise SceneError(f"{self._scene.name}: no room: {what} {one.name or index} at "
                                 f"({pose[0]:g}, {pose[1]:g}) cm {why}")  # fmt: skip
            self._placed.add(pose[0], pose[1], radius)
            return pose
        why = ""
        for x, y in self._candidates(one, index):
            why = self._obstruction(x, y, radius)
            if not why:
                self._placed.add(x, y, radius)
                return x, y
        tried = "marks left" if one.place == "marks" else f"place found in {TRIES} tries"
        raise SceneError(f"{self._scene.name}: no room: no {tried} for {what} {one.name or index}"
                         f"{f'; the last one {why}' if why else ''}")  # fmt: skip

    def _candidates(self, one: Placed, index: int) -> Iterator[Place]:
        """Yield candidate positions for body `index` of a group."""
        arena = self._scene.arena
        x = arena.width_cm / 2 if math.isnan(one.x_cm) else one.x_cm
        y = arena.height_cm / 2 if math.isnan(one.y_cm) else one.y_cm
        if one.place == "marks":
            yield from self._marks
            return
        if one.place == "circle":
            angle = 2 * math.pi * index / max(one.count, 1)
            yield x + one.circle_cm * math.cos(angle), y + one.circle_cm * math.sin(angle)
            return
        if one.place == "hexagonal":
            dx, dy = hexagonal(one.count, one.spacing_cm)[index]
            yield x + dx, y + dy
            return
        wide, deep = one.width_cm or arena.width_cm, one.depth_cm or arena.height_cm
        for _ in range(TRIES):
            if one.place == "normal":
                dx, dy = self._rng.normal(0.0, one.sd_cm, 2).tolist()
            else:
                dx, dy = (self._rng.uniform(-0.5, 0.5, 2) * (wide, deep)).tolist()
            yield x + dx, y + dy

    def _obstruction(self, x: float, y: float, radius: float) -> str:
        """Return what obstructs a disc at a position, or an empty text."""
        return obstruction(self._scene, self._outlines, self._placed.near(x, y), x, y, radius)
