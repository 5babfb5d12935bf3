"""Polygons in the plane: corners as (x, y), sides as pairs of corners. Lengths cm."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

Point = Sequence[float]
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
