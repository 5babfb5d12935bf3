"""What ring.c and light.c compute, in plain Python and bit for bit: light of other robots, and noise."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

from arena.infrared.channel import GAP_S, LINES
from arena.scene.loader import FCY

ONES = (1 << 64) - 1


def mixed(seed: int, channel: int, cycle: int) -> int:
    """64 bits (SplitMix64)."""
    x = (seed + (cycle << 8 | channel) * 0x9E37_79B9_7F4A_7C15) & ONES
    x = (x ^ x >> 30) * 0xBF58_476D_1CE4_E5B9 & ONES
    x = (x ^ x >> 27) * 0x94D0_49BB_1331_11EB & ONES
    return x ^ x >> 31


def gaussian(seed: int, channel: int, cycle: int) -> float:
    """Standard normal with its tails, to 6.6 deviations (Box and Muller): where rare errors are counted."""
    x = mixed(seed, channel, cycle)
    return math.sqrt(-2 * math.log(((x >> 32) + 1) / 2**32)) * math.cos(math.tau / 2**32 * (x & 0xFFFF_FFFF))


def uniform(seed: int, channel: int, cycle: int) -> float:
    """From 0 up to, not including, 1."""
    return (mixed(seed, channel, cycle) >> 11) / 2**53


def followed(shares: Sequence[float], lit: int, age: int, tau: float) -> list[float]:
    """`shares` after the lines have been lit as in `lit` for so long."""
    left = math.exp(-age / tau)
    return [(lit >> line & 1) + (share - (lit >> line & 1)) * left for line, share in enumerate(shares)]


def shares_by(cycles: Sequence[int], lit: Sequence[int], cycle: int, tau: float, settled: int) -> list[float]:
    """How far receivers have followed each line; lit[0] before the first switch, lit[n + 1] behind switch n."""
    index = bisect_right(cycles, cycle)
    if not index or cycle - cycles[index - 1] >= settled:
        return [float(lit[index] >> line & 1) for line in range(LINES)]
    first = bisect_right(cycles, cycles[index - 1] - settled)
    shares = [float(lit[first] >> line & 1) for line in range(LINES)]
    for place in range(first, index - 1):
        shares = followed(shares, lit[place + 1], cycles[place + 1] - cycles[place], tau)
    return followed(shares, lit[index], cycle - cycles[index - 1], tau)


def light(
    heard: Sequence[tuple[int, Sequence[float], float, Sequence[int], Sequence[int]]], now: int, seed: int,
    late: int, receivers: tuple[float, int], loss: tuple[float, int, int],
) -> float:  # fmt: skip
    """Counts taken off a sensor in a cycle of the trial. heard: robot, counts of its lines, share of the sensor, cycles
    and states of its lines. loss: share of the transmissions, cycles that are seen of one, and in how many."""
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
        for count, followed_so_far in zip(counts, shares_by(cycles, lit, now - late, *receivers), strict=True):
            one += count * followed_so_far
        total += share * one
    return total
