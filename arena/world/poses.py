"""Poses of all bodies in one array, which native code reads and writes without a copy. Lengths cm, angles rad."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.scene.placement import Place


class Poses:
    """Immutable poses of all bodies. Robots: x, y, heading; objects: x, y, and of a polygon the heading. cm and rad."""

    __slots__ = ("_objects", "_robots", "address", "counts", "values")

    def __init__(self, robots: Sequence[tuple[float, float, float]], objects: Sequence[Place]) -> None:
        headings = [place[2] for place in objects if len(place) == 3]
        numbers = [value for place in (*robots, *(place[:2] for place in objects)) for value in place]
        values = np.array(numbers + headings, dtype=np.float64)
        self._begin(values, len(robots), len(headings), values.ctypes.data)

    def _begin(self, values: NDArray[np.float64], robots: int, polygons: int, address: int) -> None:
        """Store the array of numbers; the lists of poses are created when they are first read."""
        self.values = values
        """The numbers of the robots, the positions of the objects, the headings of those that are polygons."""
        self.counts = robots, (len(values) - 3 * robots - polygons) // 2, polygons
        """Numbers of robots, objects, and polygons among the objects."""
        self.address = address
        """Address of the values in the host's memory."""
        self._robots: list[tuple[float, float, float]] | None = None
        self._objects: list[tuple[float, float]] | None = None

    @classmethod
    def of(cls, values: NDArray[np.float64], robots: int, polygons: int = 0, address: int | None = None) -> Poses:
        """Return poses of `robots` robots and `polygons` movable polygons over `values`, without a copy.

        A known `address` of `values` saves time."""
        poses = cls.__new__(cls)
        poses._begin(values, robots, polygons, values.ctypes.data if address is None else address)
        return poses

    def __reduce__(self) -> tuple[Callable[..., Poses], tuple[NDArray[np.float64], int, int]]:
        """Copy and pickle by value: the address is valid in one process only."""
        return Poses.of, (self.values, self.counts[0], self.counts[2])

    @property
    def robots(self) -> list[tuple[float, float, float]]:
        """Poses of the robots: x, y, heading."""
        if self._robots is None:
            count = 3 * self.counts[0]
            numbers = self.values[:count].tolist()
            self._robots = list(zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True))
        return self._robots

    @property
    def objects(self) -> list[tuple[float, float]]:
        """Positions of the objects: x, y."""
        if self._objects is None:
            first = 3 * self.counts[0]
            numbers = self.values[first : first + 2 * self.counts[1]].tolist()
            self._objects = list(zip(numbers[::2], numbers[1::2], strict=True))
        return self._objects

    @property
    def headings(self) -> list[float]:
        """Headings of the objects that are polygons, in their order."""
        return list(map(float, self.values[3 * self.counts[0] + 2 * self.counts[1] :]))


class PoseBlock(NamedTuple):
    """Consecutive quanta whose poses are contiguous in memory."""

    first: int
    last: int
    """Ticks at the end of the first and the last quantum."""
    sheet: NDArray[np.float64]
    """Pose buffer that contains the block."""
    row: int
    """Row of the pose buffer with the poses of the first quantum."""
    address: int
    """Address of that row."""
