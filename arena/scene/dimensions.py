"""Dimensions of what stands in the arena, each with its source. Lengths in cm, masses in kg, heights above the floor.

Where a camera or a robot's board speaks mm, the name says so.
"""

from __future__ import annotations

import math
from typing import Final

GRAVITY: Final = 981.0
"""cm/s^2."""

ROBOT_RADIUS: Final = 3.7
"""Half of 74 mm (epuck.md §4)."""
ROBOT_MASS: Final = 0.152
"""epuck.md §4, Enki."""
ROBOT_HEIGHT: Final = 5.5
"""epuck.md §4; the green skirt is taken to cover all of it (UNVERIFIED)."""
AXLE: Final = 5.1
"""Distance of the wheels: 5.1 as in Enki and the published experiment; 5.3 on the site (epuck.md §3, §8)."""
CM_PER_STEP: Final = 0.0128
"""Travel of a wheel's rim per motor step (epuck.md §3)."""
WHEEL_SPEED: Final = 12.8
"""Fastest wheel, cm/s (epuck.md §3)."""
THRUST: Final = 1.0
"""N, both wheels together: 0.7 m g = 1.04, ARGoS limits to 1.5 (epuck.md §3); experiment-contract.md §3 takes 1.0."""
BRAKE: Final = 1.04
"""N it takes to push a robot whose wheels stand still: its tyres have to slip, 0.7 m g (epuck.md §3). The gears do not
turn backwards, and less drives it than holds it: otherwise one robot would push another for ever."""

OBJECT_RADIUS: Final = 5.0
OBJECT_HEIGHT: Final = 10.0
OBJECT_MASS: Final = 0.035
"""Cylinders of the experiment: 10 cm wide and high, 35 g (epuck.md §8)."""
FLOOR_FRICTION: Final = 0.58
"""Objects on the floor, UNVERIFIED (epuck.md §4)."""
CONTACT_FRICTION: Final = 0.3
"""Robots, objects and walls against each other, UNVERIFIED (epuck.md §4)."""
WALL_HEIGHT: Final = 50.0
"""epuck.md §8."""

CAMERA_AHEAD: Final = 3.3
"""Of the robot's centre; 3.0 to 3.7 (epuck.md §7.6)."""
CAMERA_HEIGHT: Final = 2.8
"""epuck.md §7.6."""
FOCAL_PIXELS: Final = 602.0
"""Focal length in pixels of the 640 x 480 picture (epuck.md §7.6)."""
CENTRE_X, CENTRE_Y = 320.0, 240.0
"""Optical axis in that picture (epuck.md §7.6)."""

RING_HEIGHTS: Final = (3.5, 4.5)
FRONT_HEIGHTS: Final = (1.1, 1.9)
"""Between which heights LEDs of the ring and the front one shine, UNVERIFIED."""
LED_COS: Final = math.cos(0.5 / ROBOT_RADIUS)
"""Cosine of half the angle of the edge one lights: 1 cm, UNVERIFIED."""

IR_BEARINGS_DEG: Final = (18.0, 45.0, 90.0, 142.0, 218.0, 270.0, 315.0, 342.0)
"""Clockwise from the front (epuck.md §5); each sensor looks radially from the body's edge."""
IR_RANGE: Final = 10.0
"""The response table ends here (epuck.md §5)."""


def disc_moment(mass: float, radius: float) -> float:
    """Moment of inertia of a disc about its centre, kg cm^2."""
    return mass * radius * radius / 2


def floor_force(mass: float, friction: float) -> float:
    """Greatest friction force on the floor in pymunk's unit here, kg cm/s^2 (0.01 N)."""
    return mass * GRAVITY * friction


def floor_torque(mass: float, radius: float, friction: float) -> float:
    """Greatest friction torque of a disc that presses evenly: 2/3 of force times radius, so that spin falls by
    4 mu g / (3 r) (epuck.md §4)."""
    return 2 / 3 * floor_force(mass, friction) * radius


def newton(force_n: float) -> float:
    """Newton to kg cm/s^2."""
    return 100.0 * force_n


def normalised(angle: float) -> float:
    """The same angle between -pi and pi."""
    return math.remainder(angle, 2 * math.pi)
