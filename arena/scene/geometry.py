"""Polygons in the plane: corners as (x, y), sides as pairs of corners. Lengths cm."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from itertools import combinations

Point = Sequence[float]
Corners = tuple[tuple[float, float], ...]
Side = tuple[float, float, float, float]
"""x and y of both ends."""


def sides(points: Sequence[Point]) -> list[Side]:
    """Return the sides of the closed outline."""
    return [(a[0], a[1], b[0], b[1]) for a, b in zip(points, [*points[1:], points[0]], strict=True)]


def area(points: Sequence[Point]) -> float:
    """Return the signed area, positive if the corners are in counter-clockwise order."""
    return sum(x1 * y2 - x2 * y1 for x1, y1, x2, y2 in sides(points)) / 2


def is_simple(points: Sequence[Point]) -> bool:
    """Whether a polygon has an area and its sides meet only at common corners."""
    outline = sides(points)
    if abs(area(points)) < 1e-9 or len({tuple(point) for point in points}) < len(points):
        return False
    count = len(outline)
    for one, other in combinations(range(count), 2):
        if other - one not in (1, count - 1) and _cross(outline[one], outline[other]):
            return False
    return True


def is_convex(points: Sequence[Point]) -> bool:
    """Whether a simple polygon turns to one side only at its corners."""
    turns = [_turn(*one, *other[2:]) for one, other in zip(sides(points), sides([*points[1:], points[0]]), strict=True)]
    return all(turn >= 0 for turn in turns) or all(turn <= 0 for turn in turns)


@cache
def centred(points: tuple[tuple[float, ...], ...]) -> Corners:
    """Return the corners of a polygon relative to its centroid, counter-clockwise."""
    if area(points) < 0:
        points = points[::-1]
    whole, x, y = 6 * area(points), 0.0, 0.0
    for x1, y1, x2, y2 in sides(points):
        cross = x1 * y2 - x2 * y1
        x, y = x + (x1 + x2) * cross / whole, y + (y1 + y2) * cross / whole
    return tuple((one[0] - x, one[1] - y) for one in points)


def turned(points: Corners, x: float, y: float, heading: float) -> list[tuple[float, float]]:
    """Return corners turned by `heading` rad about the origin, and then moved by (x, y)."""
    cos, sin = math.cos(heading), math.sin(heading)
    return [(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in points]


def mean_distance(points: Corners) -> float:
    """Return the mean distance of the points of a convex polygon from the origin, which is inside; cm.

    The polygon is divided into triangles with a corner at the origin. With `h` as the distance of a side from the
    origin, the integral of the distance over its triangle is that of h^3 / (3 cos^3) over the angle."""
    total = 0.0
    for x1, y1, x2, y2 in sides(points):
        length = math.hypot(x2 - x1, y2 - y1)
        height = (x1 * y2 - x2 * y1) / length
        for x, y, sign in ((x1, y1, -1), (x2, y2, 1)):
            slope = ((x2 - x1) * x + (y2 - y1) * y) / length / height
            total += sign * height**3 / 6 * (slope * math.sqrt(1 + slope * slope) + math.asinh(slope))
    return total / area(points)


def _turn(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Return twice the signed area of a triangle: positive for a left turn."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _cross(one: Side, other: Side) -> bool:
    """Whether two sides have a common point."""
    a, b = _turn(*one, other[0], other[1]), _turn(*one, other[2], other[3])
    c, d = _turn(*other, one[0], one[1]), _turn(*other, one[2], one[3])
    if (a > 0) != (b > 0) and (c > 0) != (d > 0):
        return True
    return any(turn == 0 and distance_to(x, y, side) == 0 for turn, x, y, side in
               ((a, other[0], other[1], one), (b, other[2], other[3], one),
                (c, one[0], one[1], other), (d, one[2], one[3], other)))  # fmt: skip


def contains(points: Sequence[Point], x: float, y: float) -> bool:
    """Whether a point is in a polygon: a ray to the right crosses an odd number of sides."""
    inside = False
    for x1, y1, x2, y2 in sides(points):
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) / (y2 - y1) * (x2 - x1):
            inside = not inside
    return inside


def distance_to(x: float, y: float, side: Side) -> float:
    """Return the distance from a point to the nearest point of a side."""
    x1, y1, x2, y2 = side
    dx, dy = x2 - x1, y2 - y1
    length2 = dx * dx + dy * dy
    along = 0.0 if length2 == 0 else min(max(((x - x1) * dx + (y - y1) * dy) / length2, 0.0), 1.0)
    return float(((x - x1 - along * dx) ** 2 + (y - y1 - along * dy) ** 2) ** 0.5)
