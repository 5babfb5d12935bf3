"""Repeatable, stateless noise: a function of seed, channel and cycle, so that repeated reads give the same value."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.peripherals.base import StateCell
from emu.system.record import Record

_ONES: Final = (1 << 64) - 1
_SCALE_ONE: Final = 1 << 16


def _splitmix64(seed: int, channel: int, cycle: int) -> int:
    """Return 64 pseudo-random bits (SplitMix64)."""
    x = (seed + (cycle << 8 | channel) * 0x9E37_79B9_7F4A_7C15) & _ONES
    x = (x ^ x >> 30) * 0xBF58_476D_1CE4_E5B9 & _ONES
    x = (x ^ x >> 27) * 0x94D0_49BB_1331_11EB & _ONES
    return x ^ x >> 31


class Noise:
    """Approximately Gaussian noise for analog inputs. Strength and seed are in the record.

    Strength 0 (the default) means no noise, 1 the standard deviations of the reference.
    """

    def __init__(self, record: Record, seed: int = 0) -> None:
        self._seed: Final = StateCell(record, "noise.seed", "Q", seed & _ONES)
        self._strength: Final = StateCell(record, "noise.strength", "Q")
        self.on_change: Final[list[Callable[[], None]]] = []
        """Callbacks that run before and after a change of the strength; parts that predict levels use them."""

    @property
    def strength(self) -> float:
        """Factor on every standard deviation."""
        return self._strength.value / _SCALE_ONE

    @strength.setter
    def strength(self, strength: float) -> None:
        for callback in self.on_change:
            callback()
        self._strength.value = round(strength * _SCALE_ONE)
        for callback in self.on_change:
            callback()

    def at(self, channel: int, cycle: int, deviation: float) -> float:
        """Return the noise of a channel at a cycle, with standard deviation `deviation`."""
        if not self._strength.value:
            return 0.0
        x = _splitmix64(self._seed.value, channel, cycle)
        # The sum of four uniform random numbers, each with variance 1/12, has the standard deviation 1 / 3**0.5.
        total = sum(x >> shift & 0xFFFF for shift in (0, 16, 32, 48)) / 0x10000 - 2
        return total * 3**0.5 * deviation * self.strength
