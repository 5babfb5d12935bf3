"""Closed-form arithmetic of a timer's counter (§7 rules 1, 4, 5)."""

from __future__ import annotations

from typing import Final

PRESCALE: Final = (1, 8, 64, 256)
"""Number of clocks per count for TCKPS = 0..3 (§7)."""


def advance(start: int, counts: int, period: int, top: int) -> int:
    """Return the count after `counts` steps from `start`.

    The counter wraps to 0 after `period` (PR) and also after `top`.
    """
    if start > period:
        if start + counts <= top:
            return start + counts
        counts -= top + 1 - start
        start = 0
    return (start + counts) % (period + 1)


def counts_until(start: int, target: int, period: int, top: int) -> int | None:
    """Return the number of counts, at least 1, until the counter equals `target`; None if it never does."""
    if start > period:
        if start < target:
            return target - start
        return top + 1 - start + target if target <= period and (target or period) else None
    if target > period or period == 0:
        return None
    return target - start if target > start else target - start + period + 1
