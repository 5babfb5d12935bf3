"""Start positions: robots and objects on marks of a grid, chosen by the trial's generator (epuck.md §8, experiment)."""

from __future__ import annotations

import math

import numpy as np

from arena import bodies
from arena.scene import Scene, SceneError

Place = tuple[float, float]


def marks_of(scene: Scene) -> list[Place]:
    """Marks in cm from the lower left corner, row by row; those outside the walls are left out."""
    grid, arena = scene.marks, scene.arena
    left = (arena.width_cm - (grid.columns - 1) * grid.spacing_cm) / 2
    low = (arena.height_cm - (grid.rows - 1) * grid.spacing_cm) / 2
    places = ((left + c * grid.spacing_cm, low + r * grid.spacing_cm) for r in range(grid.rows)
              for c in range(grid.columns))  # fmt: skip
    return [(x, y) for x, y in places if 0 < x < arena.width_cm and 0 < y < arena.height_cm]


def place_all(scene: Scene, rng: np.random.Generator) -> tuple[list[tuple[float, float, float]], list[Place]]:
    """Poses of the robots (x, y in cm, heading in rad) and places of the objects, no two touching.

    Raises SceneError if there is no room: too few marks, or marks too near each other or to a wall.
    """
    radii = [bodies.ROBOT_RADIUS] * scene.robots.count + [scene.objects.radius_cm] * scene.objects.count
    marks = marks_of(scene)
    if len(radii) > len(marks):
        raise SceneError(f"{scene.name}: no room: {len(radii)} robots and objects on {len(marks)} marks")
    chosen = [marks[index] for index in rng.permutation(len(marks))[: len(radii)]]
    for index, ((x, y), radius) in enumerate(zip(chosen, radii, strict=True)):
        nearest = min(x, y, scene.arena.width_cm - x, scene.arena.height_cm - y)
        if nearest < radius:
            where = f"the mark at ({x:g}, {y:g}) cm is nearer to a wall than {radius:g} cm"
            raise SceneError(f"{scene.name}: no room: {where}")
        for (other_x, other_y), other in zip(chosen[:index], radii[:index], strict=True):
            if math.hypot(x - other_x, y - other_y) < radius + other:
                raise SceneError(f"{scene.name}: no room: marks are {scene.marks.spacing_cm:g} cm apart")
    headings = rng.uniform(-math.pi, math.pi, scene.robots.count).tolist()
    robots = [(x, y, angle) for (x, y), angle in zip(chosen, headings, strict=False)]
    return robots, chosen[scene.robots.count :]
