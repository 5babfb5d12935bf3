"""Time base of the motor control PWM as arithmetic: counts, periods and edges of the duty cycle comparison.

Source: data sheet DS70135G §15. A *tick* is one count of PTMR, 1, 4, 16 or 64 Tcy long.

UNVERIFIED: an up/down period is 2 PTPER ticks, because 0 and PTPER are each counted once; editions of the manual
differ. An edge in the middle of a Tcy (PDC<0> = 1) is seen in the next one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from emu.system.events import NEVER

FREE_RUNNING, SINGLE_SHOT, UP_DOWN, DOUBLE_UPDATE = range(4)
"""Values of PTMOD."""
PRESCALE = (1, 4, 16, 64)
"""Tcy per tick, by PTCKPS."""


@dataclass(frozen=True, slots=True)
class TimeBase:
    """One period of the time base, which begins with PTMR = 0 in cycle `zero`."""

    zero: int
    period: int
    """Latched PTPER."""
    tick: int
    """Length of a tick in Tcy."""
    centred: bool
    """Whether the time base counts up and down."""

    @property
    def length(self) -> int:
        """Length of the period in Tcy."""
        return self.tick * (2 * self.period if self.centred else self.period + 1)

    @property
    def end(self) -> int:
        """First cycle of the next period; NEVER with PTPER = 0, which stops the time base (§15.1)."""
        return self.zero + self.length if self.period else NEVER

    def count(self, cycle: int) -> tuple[int, bool]:
        """Return PTMR<14:0> and whether it counts downwards (PTDIR), at a cycle of the period."""
        ticks = max(cycle - self.zero, 0) // self.tick
        if not self.centred or ticks < self.period:
            return min(ticks, self.period), False
        return max(2 * self.period - ticks, 0), True

    def cycle_of(self, count: int, downwards: bool) -> int:
        """Return the first cycle in which PTMR equals `count` and counts in that direction; NEVER if there is none."""
        if count > self.period or (downwards and not self.centred):
            return NEVER
        return self.zero + self.tick * (2 * self.period - count if downwards else count)

    def edges(self, duty: int) -> Iterator[tuple[int, bool]]:
        """Yield (cycle, level) of the comparison's output for a latched PDC, in order, from the period's start on."""
        half = (duty * self.tick + 1) // 2
        if not self.centred:
            yield self.zero, duty > 0
            if duty > 0 and duty >> 1 <= self.period:
                yield self.zero + half, False
            return
        full = duty >> 1 >= self.period
        yield self.zero, duty > 0
        if duty > 0 and not full:
            yield self.zero + half, False
            yield self.zero + self.length - half, True

    def level(self, duty: int, cycle: int) -> bool:
        """Return the output of the comparison at a cycle of the period."""
        return [level for edge, level in self.edges(duty) if edge <= cycle or edge == self.zero][-1]

    def next_edge(self, duty: int, after: int) -> int:
        """Return the first cycle after `after` in which the comparison's output may change; NEVER in this period."""
        return min((edge for edge, _ in self.edges(duty) if edge > after), default=NEVER)
