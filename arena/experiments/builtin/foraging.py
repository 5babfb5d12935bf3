"""Foraging: robots that touch food are told so, and that they have reached the nest; food grows again elsewhere.

The supervisor stands for what a gripper and a floor sensor would do: the robot has neither. Everything it does goes
through the robot's Bluetooth link.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from arena.experiments import Curve, Sample
from arena.scene import dimensions
from arena.scene.loader import Scene

if TYPE_CHECKING:
    from arena.experiments.supervisor import Stage

CURVES = [
    Curve("delivered", "food carried to the nest", "pieces"),
    Curve("carrying", "robots that carry food", "%", 100, 1.0),
]
TOUCH_CM = 0.5
"""Gap up to which food counts as touched."""
CLEAR_CM = 8.0
"""Food grows where nothing is nearer than this, and not in the nest."""
TRIES = 500


def init(stage: Stage) -> None:
    """Nobody carries anything yet."""
    stage.memory["loaded"] = set()
    stage.note("delivered", 0)
    stage.note("carrying", 0)


def step(stage: Stage) -> None:
    """Ten times a second: who has touched food, who is in the nest?"""
    loaded, objects = stage.memory["loaded"], stage.objects
    x_nest, y_nest, radius = _nest(stage.scene)
    for robot, (x, y, _) in enumerate(stage.robots.tolist()):
        if robot in loaded:
            if math.hypot(x - x_nest, y - y_nest) < radius:
                loaded.discard(robot)
                stage.note("delivered", stage.noted["delivered"] + 1)
                stage.tell(robot, "nest\n")
            continue
        for number, (ox, oy) in enumerate(objects.tolist()):
            reach = dimensions.ROBOT_RADIUS + stage.scene.kind_of(number).radius_cm + TOUCH_CM
            if math.hypot(x - ox, y - oy) < reach:
                loaded.add(robot)
                _regrow(stage, number)
                objects = stage.objects
                stage.tell(robot, "food\n")
                break
    stage.note("carrying", len(loaded))


def _regrow(stage: Stage, number: int) -> None:
    """Elsewhere, where there is room."""
    arena, (x_nest, y_nest, radius) = stage.scene.arena, _nest(stage.scene)
    for _ in range(TRIES):
        x, y = (stage.rng.uniform(0.05, 0.95, 2) * (arena.width_cm, arena.height_cm)).tolist()
        things = [*stage.robots[:, :2].tolist(), *stage.objects.tolist()]
        is_free = all(math.hypot(x - ox, y - oy) > 2 * CLEAR_CM for ox, oy in things)
        if is_free and math.hypot(x - x_nest, y - y_nest) > radius + CLEAR_CM:
            stage.move_object(number, x, y)
            return


def _nest(scene: Scene) -> tuple[float, float, float]:
    nest = next(patch for patch in scene.patches if patch.name == "nest")
    return nest.x_cm, nest.y_cm, nest.radius_cm


def metrics(sample: Sample) -> dict[str, float]:
    """What the supervisor noted."""
    robots = max(len(sample.robots), 1)
    return {"delivered": sample.noted["delivered"], "carrying": sample.noted["carrying"] / robots}
