"""Dimensions of the bodies in the arena, each with its source. Lengths in cm, masses in kg, heights above the floor."""

from __future__ import annotations

import math
from typing import Final

GRAVITY: Final = 981.0
"""cm/s^2."""

ROBOT_RADIUS: Final = 3.7
"""Half of 74 mm (epuck.md §4)."""
ROBOT_MASS: Final = 0.152
"""Value of Enki (epuck.md §4)."""
ROBOT_HEIGHT: Final = 5.5
"""epuck.md §4. The green skirt is assumed to cover all of it (UNVERIFIED)."""
AXLE: Final = 5.1
"""Distance of the wheels: 5.1 in Enki and the published experiment; 5.3 on the e-puck's web site (epuck.md §3, §8)."""
CM_PER_STEP: Final = 0.0128
"""Travel of a wheel's rim per motor step (epuck.md §3)."""
WHEEL_SPEED: Final = 12.8
"""Greatest wheel speed, cm/s (epuck.md §3)."""
THRUST: Final = 1.0
"""Largest force of both wheels, N: 0.7 m g = 1.04, in ARGoS 1.5 (epuck.md §3); experiment-contract.md §3 takes 1.0."""
BRAKE: Final = 1.04
"""Force in N that pushes a robot whose wheels are at rest: its tyres must slip, 0.7 m g (epuck.md §3).

The wheels cannot turn the gears. The value is above THRUST: otherwise one robot could push another for ever.
"""

KILOBOT_RADIUS, KILOBOT_HEIGHT = 1.65, 3.4
"""Half of 33 mm; 34 mm with the legs (kilobot.md §1)."""
KILOBOT_MASS: Final = 0.01
"""Value of ARGoS (kilobot.md §1). UNVERIFIED on a robot."""

OBJECT_RADIUS: Final = 5.0
OBJECT_HEIGHT: Final = 10.0
OBJECT_MASS: Final = 0.035
"""Cylinders of the experiment: diameter and height 10 cm, 35 g (epuck.md §8)."""
FLOOR_FRICTION: Final = 0.58
"""Friction of objects on the floor, UNVERIFIED (epuck.md §4)."""
CONTACT_FRICTION: Final = 0.3
"""Friction between robots, objects and walls, UNVERIFIED (epuck.md §4)."""
WALL_HEIGHT: Final = 50.0
"""Height of the walls (epuck.md §8)."""

CAMERA_AHEAD: Final = 3.3
"""Lens ahead of the robot's centre; sources say 3.0 to 3.7 (epuck.md §7.6)."""
CAMERA_HEIGHT: Final = 2.8
"""Height of the lens (epuck.md §7.6)."""
FOCAL_PIXELS: Final = 602.0
"""Focal length in pixels of the 640 x 480 picture (epuck.md §7.6)."""
CENTRE_X, CENTRE_Y = 320.0, 240.0
"""Optical axis in that picture (epuck.md §7.6)."""

RING_HEIGHTS: Final = (3.5, 4.5)
FRONT_HEIGHTS: Final = (1.1, 1.9)
"""Lower and upper heights of the ring LEDs and of the front LED, UNVERIFIED."""
LED_COS: Final = math.cos(0.5 / ROBOT_RADIUS)
"""Cosine of half the angle of the edge that an LED lights, 1 cm, UNVERIFIED."""

IR_BEARINGS_DEG: Final = (18.0, 45.0, 90.0, 142.0, 218.0, 270.0, 315.0, 342.0)
"""Bearings of the sensors, clockwise from the front; each one faces radially outwards from the edge (epuck.md §5)."""
IR_HALF_BEAM_DEG: Final = 15.0
"""Half-angle of the beam of an infrared sensor in degrees (epuck.md §5)."""
IR_HEIGHT: Final = 2.5
"""Height of the infrared ring (epuck.md §9: that of the Enki model)."""
IR_RANGE: Final = 10.0
"""Range of the infrared sensors: the end of the response table (epuck.md §5)."""


def disc_moment(mass: float, radius: float) -> float:
    """Return the moment of inertia of a disc about its centre, kg cm^2."""
    return mass * radius * radius / 2


def floor_force(mass: float, friction: float) -> float:
    """Return the greatest friction force on the floor, kg cm/s^2 (0.01 N), the unit of the physics."""
    return mass * GRAVITY * friction


def floor_torque(mass: float, radius: float, friction: float) -> float:
    """Return the greatest friction torque of a disc with even pressure: 2/3 of force times radius.

    So its spin decreases by 4 mu g / (3 r) (epuck.md §4).
    """
    return 2 / 3 * floor_force(mass, friction) * radius


def newton(force_n: float) -> float:
    """Convert newton to kg cm/s^2."""
    return 100.0 * force_n


def normalised(angle: float) -> float:
    """Return the equivalent angle between -pi and pi."""
    return math.remainder(angle, 2 * math.pi)
