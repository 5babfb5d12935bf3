"""Reference implementation in Python of light.c and of the noise in ring.c, equal to the bit."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

from arena.infrared.channel import GAP_S, LINES
from arena.scene.loader import FCY

ONES = (1 << 64) - 1


def mixed(seed: int, channel: int, cycle: int) -> int:
    """Return a 64-bit hash (SplitMix64)."""
    x = (seed + (cycle << 8 | channel) * 0x9E37_79B9_7F4A_7C15) & ONES
    x = (x ^ x >> 30) * 0xBF58_476D_1CE4_E5B9 & ONES
    x = (x ^ x >> 27) * 0x94D0_49BB_1331_11EB & ONES
    return x ^ x >> 31


def gaussian(seed: int, channel: int, cycle: int) -> float:
    """Return a standard normal number (Box and Muller), whose tails reach 6.6 deviations so that rare errors occur."""
    x = mixed(seed, channel, cycle)
    return math.sqrt(-2 * math.log(((x >> 32) + 1) / 2**32)) * math.cos(math.tau / 2**32 * (x & 0xFFFF_FFFF))


def uniform(seed: int, channel: int, cycle: int) -> float:
    """Return a number from 0 (included) to 1 (excluded)."""
    return (mixed(seed, channel, cycle) >> 11) / 2**53


def settle(shares: Sequence[float], lit: int, age: int, tau: float) -> list[float]:
    """Return the levels `shares` of the receivers after `age` cycles during which `lit` was the state of the lines."""
    left = math.exp(-age / tau)
    return [(lit >> line & 1) + (share - (lit >> line & 1)) * left for line, share in enumerate(shares)]


def levels_by(cycles: Sequence[int], lit: Sequence[int], cycle: int, tau: float, settled: int) -> list[float]:
    """Return the level of each line at a cycle. `lit`: state before the first change, then after each change."""
    index = bisect_right(cycles, cycle)
    if not index or cycle - cycles[index - 1] >= settled:
        return [float(lit[index] >> line & 1) for line in range(LINES)]
    first = bisect_right(cycles, cycles[index - 1] - settled)
    shares = [float(lit[first] >> line & 1) for line in range(LINES)]
    for place in range(first, index - 1):
        shares = settle(shares, lit[place + 1], cycles[place + 1] - cycles[place], tau)
    return settle(shares, lit[index], cycle - cycles[index - 1], tau)


def light(
    heard: Sequence[tuple[int, Sequence[float], float, Sequence[int], Sequence[int]]], now: int, seed: int,
    late: int, receivers: tuple[float, int], loss: tuple[float, int, int],
) -> float:  # fmt: skip
    """Return the counts by which light lowers a sensor at a cycle of the trial.

    `heard`: for each robot, the counts of its lines, the share of the sensor, and cycles and states of its lines.
    `loss`: share of lost transmissions, visible cycles of a lost transmission, and their period.
    """
    total = 0.0
    for robot, counts, share, cycles, lit in heard:
        index = bisect_right(cycles, now - late)
        begun, before = now - late, 0
        for place, cycle in enumerate(cycles[:index]):
            if place == 0 or (not lit[place] and cycle - before > GAP_S * FCY):
                begun = cycle
            before = cycle
        if (now - late - begun) % loss[2] >= loss[1] and uniform(seed + robot, 8, begun) < loss[0]:
            continue
        one = 0.0
        for count, level in zip(counts, levels_by(cycles, lit, now - late, *receivers), strict=True):
            one += count * level
        total += share * one
    return total
