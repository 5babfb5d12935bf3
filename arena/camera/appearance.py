"""What things look like to a camera: classes of what a pixel can show, their colours, and what a furnished scene adds.

What enters: a scene; what leaves: a `Look`, which knows no camera. Lengths cm.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.scene import dimensions, geometry
from arena.scene.loader import Scene
from arena.scene.schema import NAMED, Patch

NOTHING, OBJECT, ROBOT, WALL, FLOOR, ABOVE = range(6)
"""What a pixel shows; NOTHING is only an answer of the whole sensor, ABOVE is the room over the walls."""
NAMES: Final = ("nothing", "object", "robot", "wall", "floor", "above")

COLOURS: Final = np.array(
    [(100, 90, 90), (90, 14, 14), (10, 48, 14), (112, 100, 100), (100, 90, 88), (120, 110, 110)], dtype=np.uint8
)
"""As the sensor shows them in the light of the experiment: made to lie near the references of the firmware's
classifier, red (80,0,0), green (0,40,0), white (100,80,80) (openswarm-original.md §8). UNVERIFIED on a robot."""

LED_COLOURS: Final = ((220, 24, 20), (16, 110, 24))
"""A red LED that is lit, and a body that is lit by the green one within: red and green for the firmware's
classifier. They go with the room's brightness like everything else. UNVERIFIED"""
LAMPS: Final = (
    *((math.cos(math.tau / 8 * led), -math.sin(math.tau / 8 * led), *dimensions.RING_HEIGHTS) for led in range(8)),
    (1.0, 0.0, *dimensions.FRONT_HEIGHTS),
)
"""Where LEDs shine on a robot's edge, in the order of a record's `leds`: direction (forward, left), from and to which
height. The ring's LED 0 is in front, the others go clockwise (epuck.md §2). The body's has no place of its own."""

_REFERENCES: Final = {OBJECT: (80, 0, 0), ROBOT: (0, 40, 0), NOTHING: (100, 80, 80)}
"""Of the firmware's classifier (openswarm-original.md §8); dark is none of them."""


class Look(NamedTuple):
    """What a furnished scene shows: `colours` by class, of objects (radius, height, class), of what stands fast sides
    (ends, height, class) and discs (x, y, radius, height, class), patches of the floor with their classes."""

    colours: NDArray[np.uint8]
    objects: list[tuple[float, float, int]]
    sides: list[tuple[geometry.Side, float, int]]
    discs: list[tuple[float, float, float, float, int]]
    patches: list[tuple[Patch, int]]
    sensed: list[int]

    def floor_at(self, x: float, y: float) -> int:
        """Class of the floor at a place: the last patch that covers it."""
        found = FLOOR
        for patch, kind in self.patches:
            if patch.polygon:
                found = kind if geometry.contains(patch.polygon, x, y) else found
            elif math.hypot(x - patch.x_cm, y - patch.y_cm) < patch.radius_cm:
                found = kind
        return found


_looks: dict[int, tuple[Scene, Look]] = {}


def look_of(scene: Scene) -> Look:
    """How a furnished scene looks; asked for again and again by every camera."""
    kept = _looks.get(id(scene))
    if kept is None or kept[0] is not scene:
        if len(_looks) > 16:
            _looks.clear()
        kept = _looks[id(scene)] = scene, _look(scene)
    return kept[1]


def _look(scene: Scene) -> Look:
    colours = [tuple(map(int, one)) for one in COLOURS]

    def kind(name: str) -> int:
        colour = NAMED.get(name) or tuple(bytes.fromhex(name[1:]))
        if colour not in colours:
            colours.append(colour)
        return colours.index(colour)

    objects = [
        (one.radius_cm, one.height_cm, kind(one.colour)) for one in map(scene.kind_of, range(scene.objects.count))
    ]
    room = geometry.sides(scene.arena.polygon) if scene.arena.polygon else []
    sides = [(side, dimensions.WALL_HEIGHT, WALL) for side in room]
    sides += [(side, one.height_cm, kind(one.colour)) for one in scene.obstacles if one.polygon
              for side in geometry.sides(one.polygon)]  # fmt: skip
    discs = [(one.x_cm, one.y_cm, one.radius_cm, one.height_cm, kind(one.colour))
             for one in scene.obstacles if one.radius_cm]  # fmt: skip
    patches = [(patch, kind(patch.colour)) for patch in scene.patches]
    sensed = list(range(len(COLOURS))) + [_taken_for(colour) for colour in colours[len(COLOURS) :]]
    return Look(np.array(colours, dtype=np.uint8), objects, sides, discs, patches, sensed)


def _taken_for(colour: tuple[int, ...]) -> int:
    """The reference a colour is nearest to, as the firmware decides it; the first that is nearest."""
    away = {
        one: sum(abs(a - b) for a, b in zip(colour, reference, strict=True)) for one, reference in _REFERENCES.items()
    }
    away[NOTHING] = min(away[NOTHING], sum(colour))
    return min(away, key=lambda one: away[one])


def colours_of(scene: Scene) -> NDArray[np.uint8]:
    """Red, green and blue of every class of a scene, those of `led_kinds` behind the others."""
    return np.concatenate((_plain_colours(scene), np.array(LED_COLOURS, dtype=np.uint8)))


def _plain_colours(scene: Scene) -> NDArray[np.uint8]:
    return look_of(scene).colours if scene.is_furnished else COLOURS


def led_kinds(scene: Scene) -> tuple[int, int]:
    """Classes of a LED that is lit and of a body that is."""
    count = len(_plain_colours(scene))
    return count, count + 1
