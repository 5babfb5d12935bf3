"""Reactive controllers: tables from sensor answer to wheel speeds, without memory (epuck.md §8).

Speeds are percentages of 129 mm/s, truncated to whole mm/s as in the firmware (openswarm-original.md §8). A negative
speed turns the wheel backwards.
"""

from __future__ import annotations

from typing import Final

from arena.camera.appearance import NOTHING, OBJECT, ROBOT

MAXIMUM_MM_S: Final = 129
STEPS_PER_S: Final = 1000
"""Motor steps per second at MAXIMUM_MM_S (openswarm-original.md §5.2)."""
SPEED_TABLES: Final = {
    "A": {NOTHING: (50, 100), OBJECT: (100, 50), ROBOT: (10, 50)},
    "B": {NOTHING: (55, 99), OBJECT: (98, 50), ROBOT: (89, 53)},
    "aggregate": {NOTHING: (-70, -100), OBJECT: (-70, -100), ROBOT: (100, -100)},
}
"""A and B cluster objects: the published values as recalled (UNVERIFIED), and the constants of the OpenSwarm firmware
(epuck.md §8). `aggregate` gathers robots: Gauci et al. 2014, as firmware/apps/aggregation (epuck.md §8)."""


def steps_per_second(controller: str, seen: int) -> tuple[float, float]:
    """Return the motor steps per second, left and right. Raises KeyError for an unknown controller."""
    left, right = (int(percent * MAXIMUM_MM_S / 100) for percent in SPEED_TABLES[controller][seen])
    return left * STEPS_PER_S / MAXIMUM_MM_S, right * STEPS_PER_S / MAXIMUM_MM_S
