"""Obstacle avoidance: smallest gap between a robot and anything else, and share of the floor visited."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, TrialSamples
from arena.scene import dimensions, geometry
from arena.scene.loader import Scene
from arena.scene.schema import Obstacle

CURVES = [
    Curve("gap", "smallest gap between a robot and anything", "cm"),
    Curve("covered", "share of the floor's 20 cm squares visited", "%", 100, 1.0),
]
SQUARE_CM = 20.0


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return both metrics at every sample; a square counts as visited once a robot's centre has been in it."""
    squares = _squares(samples.scene)
    visited: set[tuple[int, int]] = set()
    gaps, covered = [], []
    for robots in samples.robots[:, :, :2]:
        gaps.append(_gap(samples.scene, robots))
        visited |= {(int(x // SQUARE_CM), int(y // SQUARE_CM)) for x, y in robots.tolist()} & squares
        covered.append(len(visited) / max(len(squares), 1))
    return {"gap": np.array(gaps), "covered": np.array(covered)}


def _gap(scene: Scene, robots: Floats) -> float:
    arena = scene.arena
    shapes = [
        arena.polygon or ((0.0, 0.0), (arena.width_cm, 0.0), (arena.width_cm, arena.height_cm), (0.0, arena.height_cm))
    ]
    shapes += [one.polygon for one in scene.obstacles if one.polygon]
    gaps = [math.inf]
    for number, (x, y) in enumerate(robots.tolist()):
        gaps += [
            geometry.distance_to(x, y, side) - dimensions.ROBOT_RADIUS
            for shape in shapes
            for side in geometry.sides(shape)
        ]
        gaps += [math.hypot(x - one.x_cm, y - one.y_cm) - one.radius_cm - dimensions.ROBOT_RADIUS
                 for one in scene.obstacles if one.radius_cm]  # fmt: skip
        gaps += [math.hypot(x - ox, y - oy) - 2 * dimensions.ROBOT_RADIUS for ox, oy in robots[:number].tolist()]
    return max(min(gaps), 0.0) if len(gaps) > 1 else 0.0


def _squares(scene: Scene) -> set[tuple[int, int]]:
    """Return the squares of the floor whose centre is inside the walls and outside all obstacles."""
    arena = scene.arena
    found = set()
    for column in range(math.ceil(arena.width_cm / SQUARE_CM)):
        for row in range(math.ceil(arena.height_cm / SQUARE_CM)):
            x, y = SQUARE_CM * (column + 0.5), SQUARE_CM * (row + 0.5)
            inside = not arena.polygon or geometry.contains(arena.polygon, x, y)
            if inside and not any(_covers(one, x, y) for one in scene.obstacles):
                found.add((column, row))
    return found


def _covers(one: Obstacle, x: float, y: float) -> bool:
    if one.polygon:
        return geometry.contains(one.polygon, x, y)
    return math.hypot(x - one.x_cm, y - one.y_cm) < one.radius_cm
