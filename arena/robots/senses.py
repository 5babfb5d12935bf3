"""What a robot without firmware senses: line of sight, reflections, light and its own wheel speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from arena.camera.line_of_sight import LineOfSight
from arena.infrared.propagation import Optics
from arena.infrared.ring import ambient
from arena.scene.loader import Scene
from arena.world.physics import traits_of
from arena.world.poses import Poses
from emu.boards.epuck.analog import reflection_at

FULL_REFLECTION: Final = 3788.0
"""ADC counts of a white surface at zero distance (epuck.md §5)."""
FULL_LIGHT: Final = 4095.0


@dataclass(frozen=True, slots=True)
class Senses:
    """Sensor values of one robot at one time.

    The eight infrared sensors are those of the e-puck, clockwise from the right of the front (epuck.md §5).
    """

    seconds: float
    """Time of the trial in s."""
    seen: int
    """Answer of the line-of-sight sensor: 0 nothing, 1 an object, 2 a robot."""
    proximity: tuple[float, ...]
    """Eight reflections: 0 nothing in range, 1 a white surface that touches the robot."""
    light: tuple[float, ...]
    """Eight amounts of room light: 0 bright, 1 dark."""
    wheels: tuple[float, float]
    """Speeds of the left and the right wheel in cm/s."""


class SenseReader:
    """Reads the senses of one robot in the world of a trial."""

    def __init__(self, scene: Scene, seed: int, robot: int) -> None:
        self._scene: Final = scene
        self._robot: Final = robot
        self._optics: Final = Optics(scene)
        self._sight: Final = LineOfSight(scene, robot, traits_of(scene, seed, robot))

    def read(self, poses: Poses, seconds: float, wheels: tuple[float, float]) -> Senses:
        """Return the senses at `poses`; `wheels` are the present wheel speeds in cm/s."""
        near = tuple(share * reflection_at(distance) / FULL_REFLECTION if math.isfinite(distance) else 0.0
                     for distance, share in self._optics.surfaces(poses, self._robot))  # fmt: skip
        light = tuple(counts / FULL_LIGHT for counts in ambient(self._scene, poses.robots[self._robot]))
        return Senses(seconds, self._sight.look(poses), near, light, wheels)
