"""Appearance of a scene to a camera: pixel classes, their colours, and the bodies of a furnished scene.

Input: a scene. Output: an `Appearance`, independent of any camera. Lengths cm.
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
"""Pixel classes. NOTHING is an answer of the line-of-sight sensor only; ABOVE is the room above the walls."""
NAMES: Final = ("nothing", "object", "robot", "wall", "floor", "above")

COLOURS: Final = np.array(
    [(100, 90, 90), (90, 14, 14), (10, 48, 14), (112, 100, 100), (100, 90, 88), (120, 110, 110)], dtype=np.uint8
)
"""Colours of the classes in the light of the experiment. They are chosen near the references of the firmware's
classifier: red (80,0,0), green (0,40,0), white (100,80,80) (openswarm-original.md §8). UNVERIFIED on a robot."""

LED_COLOURS: Final = ((220, 24, 20), (16, 110, 24))
"""Colours of a lit red LED and of a body lit by its green LED: red and green for the firmware's classifier. UNVERIFIED:
like all colours, they change with the brightness of the room."""
LED_POSITIONS: Final = (
    *((math.cos(math.tau / 8 * led), -math.sin(math.tau / 8 * led), *dimensions.RING_HEIGHTS) for led in range(8)),
    (1.0, 0.0, *dimensions.FRONT_HEIGHTS),
)
"""Positions of the LEDs on a robot's edge, in the order of a record's `leds`: direction (forward, left), lower and
upper height. Ring LED 0 is in front, the others follow clockwise (epuck.md §2). The body LED has no position."""

_REFERENCES: Final = {OBJECT: (80, 0, 0), ROBOT: (0, 40, 0), NOTHING: (100, 80, 80)}
"""Reference colours of the firmware's classifier (openswarm-original.md §8). Dark pixels count as NOTHING."""


class Appearance(NamedTuple):
    """Visible bodies of a furnished scene.

    - `colours`: by class
    - `robot`: class of the robots
    - `objects`: radius (0: a polygon), height, class
    - `polygons`: of each movable polygon, in order: number of the object, corners around its centre, height, class
    - `sides`: ends, height, class of walls and polygonal obstacles
    - `discs`: x, y, radius, height, class of round obstacles
    - `patches`: patches of the floor with their classes
    - `sensor_classes`: for each class the one that the line-of-sight sensor takes it for
    """

    colours: NDArray[np.uint8]
    robot: int
    objects: list[tuple[float, float, int]]
    polygons: list[tuple[int, geometry.Corners, float, int]]
    sides: list[tuple[geometry.Side, float, int]]
    discs: list[tuple[float, float, float, float, int]]
    patches: list[tuple[Patch, int]]
    sensor_classes: list[int]

    def floor_at(self, x: float, y: float) -> int:
        """Return the class of the floor at a point: that of the last patch that covers it."""
        found = FLOOR
        for patch, kind in self.patches:
            if patch.polygon:
                found = kind if geometry.contains(patch.polygon, x, y) else found
            elif math.hypot(x - patch.x_cm, y - patch.y_cm) < patch.radius_cm:
                found = kind
        return found


_cache: dict[int, tuple[Scene, Appearance]] = {}


def appearance_of(scene: Scene) -> Appearance:
    """Return the appearance of a furnished scene, from a cache if possible."""
    cached = _cache.get(id(scene))
    if cached is None or cached[0] is not scene:
        if len(_cache) > 16:
            _cache.clear()
        cached = _cache[id(scene)] = scene, _appearance(scene)
    return cached[1]


def _appearance(scene: Scene) -> Appearance:
    """Compute the appearance of a furnished scene."""
    colours = [tuple(map(int, one)) for one in COLOURS]

    def class_of(name: str) -> int:
        """Return the class of a colour; a new colour gets a new class."""
        colour = NAMED.get(name) or tuple(bytes.fromhex(name[1:]))
        if colour not in colours:
            colours.append(colour)
        return colours.index(colour)

    kinds = list(map(scene.kind_of, range(scene.objects.count)))
    objects = [(0.0 if one.polygon else one.radius_cm, one.height_cm, class_of(one.colour)) for one in kinds]
    polygons = [(number, geometry.centred(one.polygon), one.height_cm, class_of(one.colour))
                for number, one in enumerate(kinds) if one.polygon]  # fmt: skip
    room = geometry.sides(scene.arena.polygon) if scene.arena.polygon else []
    sides = [(side, dimensions.WALL_HEIGHT, WALL) for side in room]
    sides += [(side, one.height_cm, class_of(one.colour)) for one in scene.obstacles if one.polygon
              for side in geometry.sides(one.polygon)]  # fmt: skip
    discs = [(one.x_cm, one.y_cm, one.radius_cm, one.height_cm, class_of(one.colour))
             for one in scene.obstacles if one.radius_cm]  # fmt: skip
    patches = [(patch, class_of(patch.colour)) for patch in scene.patches]
    robot, painted = class_of(scene.robots.colour), np.array(colours, dtype=np.uint8)
    sensor_classes = list(range(len(COLOURS))) + [_nearest_reference(colour) for colour in colours[len(COLOURS) :]]
    return Appearance(painted, robot, objects, polygons, sides, discs, patches, sensor_classes)


def _nearest_reference(colour: tuple[int, ...]) -> int:
    """Return the class of the nearest reference colour, as the firmware decides; the first one of equally near ones."""
    away = {
        one: sum(abs(a - b) for a, b in zip(colour, reference, strict=True)) for one, reference in _REFERENCES.items()
    }
    away[NOTHING] = min(away[NOTHING], sum(colour))
    return min(away, key=lambda one: away[one])


def colours_of(scene: Scene) -> NDArray[np.uint8]:
    """Return red, green and blue of every class of a scene; those of `led_classes` come last."""
    return np.concatenate((_plain_colours(scene), np.array(LED_COLOURS, dtype=np.uint8)))


def _plain_colours(scene: Scene) -> NDArray[np.uint8]:
    """Return the colours of the classes without those of the LEDs."""
    return appearance_of(scene).colours if scene.is_furnished else COLOURS


def led_classes(scene: Scene) -> tuple[int, int]:
    """Return the classes of a lit LED and of a lit body."""
    count = len(_plain_colours(scene))
    return count, count + 1
