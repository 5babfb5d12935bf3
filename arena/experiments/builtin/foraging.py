"""Foraging: food carried to the nest. Food that a robot has taken appears again elsewhere.

The supervisor replaces a gripper and a floor sensor, which the robot does not have. It sends the robot a Bluetooth
message when the robot touches food or reaches the nest.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING

from arena.experiments import Curve, Sample
from arena.scene import dimensions
from arena.scene.loader import Scene, SceneError

if TYPE_CHECKING:
    from arena.experiments.supervisor import Supervisor

CURVES = [
    Curve("delivered", "food carried to the nest", "pieces"),
    Curve("carrying", "robots that carry food", "%", 100, 1.0),
]
TOUCH_CM = 0.5
"""Largest gap at which a robot touches food."""
CLEAR_CM = 8.0
"""Least free distance around a new piece of food, and between it and the nest."""
TRIES = 500


def init(supervisor: Supervisor) -> None:
    """Start without loaded robots."""
    supervisor.memory["loaded"] = set()
    supervisor.note("delivered", 0)
    supervisor.note("carrying", 0)


def step(supervisor: Supervisor) -> None:
    """Load robots that touch food, unload robots in the nest, and send them messages."""
    loaded, objects = supervisor.memory["loaded"], supervisor.objects
    x_nest, y_nest, radius = _nest(supervisor.scene)
    for robot, (x, y, _) in enumerate(supervisor.robots.tolist()):
        if robot in loaded:
            if math.hypot(x - x_nest, y - y_nest) < radius:
                loaded.discard(robot)
                supervisor.note("delivered", supervisor.noted["delivered"] + 1)
                supervisor.tell(robot, "nest\n")
            continue
        for number, (ox, oy) in enumerate(objects.tolist()):
            reach = dimensions.ROBOT_RADIUS + supervisor.scene.kind_of(number).radius_cm + TOUCH_CM
            if math.hypot(x - ox, y - oy) < reach:
                loaded.add(robot)
                _regrow(supervisor, number)
                objects = supervisor.objects
                supervisor.tell(robot, "food\n")
                break
    supervisor.note("carrying", len(loaded))


def _regrow(supervisor: Supervisor, number: int) -> None:
    """Move a piece of food to a random free position."""
    arena, (x_nest, y_nest, radius) = supervisor.scene.arena, _nest(supervisor.scene)
    for _ in range(TRIES):
        x, y = (supervisor.rng.uniform(0.05, 0.95, 2) * (arena.width_cm, arena.height_cm)).tolist()
        things = [*supervisor.robots[:, :2].tolist(), *supervisor.objects.tolist()]
        is_free = all(math.hypot(x - ox, y - oy) > 2 * CLEAR_CM for ox, oy in things)
        if is_free and math.hypot(x - x_nest, y - y_nest) > radius + CLEAR_CM:
            with suppress(SceneError):  # a wall or an obstacle is there
                supervisor.move_object(number, x, y)
                return


def _nest(scene: Scene) -> tuple[float, float, float]:
    nest = next(patch for patch in scene.patches if patch.name == "nest")
    return nest.x_cm, nest.y_cm, nest.radius_cm


def metrics(sample: Sample) -> dict[str, float]:
    """Return the numbers of the supervisor."""
    robots = max(len(sample.robots), 1)
    return {"delivered": sample.noted["delivered"], "carrying": sample.noted["carrying"] / robots}
