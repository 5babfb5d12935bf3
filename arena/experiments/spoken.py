"""What robots say, as numbers over time: for experiments whose result is in the robots and not in where they stand.

In: lines `WORD NUMBER` that firmware writes to UART1. Out: per sample and robot the last number, and when it was said.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from arena.experiments import Floats, Moments
from arena.metrics import Course


def last_said(moments: Moments, word: str) -> tuple[Floats, Floats]:
    """The last number each robot has said after `word`, and the second at which it began to: both samples x robots, nan
    before the first. Lines that are no number after the word are passed over."""
    robots = moments.robots.shape[1]
    numbers, seconds = np.full((2, len(moments.times), robots), np.nan)
    for one in moments.said:
        words = one.text.split()
        if len(words) == 2 and words[0] == word:
            try:
                number = float(words[1])
            except ValueError:
                continue
            since = int(np.searchsorted(moments.times, one.seconds))
            numbers[since:, one.robot], seconds[since:, one.robot] = number, one.seconds
    return numbers, seconds


def alive(moments: Moments) -> NDArray[np.bool_]:
    """Which robots still have their battery, samples x robots (`start.off` of the scene)."""
    found = np.ones((len(moments.times), moments.robots.shape[1]), dtype=bool)
    for robot, second in moments.scene.start.off:
        found[moments.times > second, int(robot)] = False
    return found


def apart(values: Floats, among: NDArray[np.bool_]) -> Floats:
    """Greatest less smallest of the numbers among some robots, per sample; nan while one of them has none."""
    found = np.full(len(values), np.nan)
    for sample, (numbers, chosen) in enumerate(zip(values, among, strict=True)):
        if chosen.any():
            found[sample] = numbers[chosen].max() - numbers[chosen].min()
    return found


def settled_at(course: Course, holds: NDArray[np.bool_]) -> float:
    """Second of the sample from which on something holds until the end; nan if it does not at the end."""
    wrong = np.flatnonzero(~holds[: len(course.times)])
    first = int(wrong[-1]) + 1 if len(wrong) else 0
    return float(course.times[first]) if first < len(course.times) else float("nan")
