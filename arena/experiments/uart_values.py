"""Values that robots report on UART1, over time: metrics of state that is inside the robots.

Firmware reports a value as a line `WORD NUMBER`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from arena.experiments import Floats, TrialSamples
from arena.metrics import MetricSeries


def last_values(samples: TrialSamples, word: str) -> tuple[Floats, Floats]:
    """Return the last number that each robot has reported after `word`, and the time of its line in s.

    Both are samples x robots, and nan before the first report. Lines without a number after the word are ignored."""
    robots = samples.robots.shape[1]
    numbers, seconds = np.full((2, len(samples.times), robots), np.nan)
    for one in samples.uart_lines:
        words = one.text.split()
        if len(words) == 2 and words[0] == word:
            try:
                number = float(words[1])
            except ValueError:
                continue
            since = int(np.searchsorted(samples.times, one.seconds))
            numbers[since:, one.robot], seconds[since:, one.robot] = number, one.seconds
    return numbers, seconds


def alive(samples: TrialSamples) -> NDArray[np.bool_]:
    """Return which robots are switched on, samples x robots (`start.off` of the scene)."""
    found = np.ones((len(samples.times), samples.robots.shape[1]), dtype=bool)
    for robot, second in samples.scene.start.off:
        found[samples.times > second, int(robot)] = False
    return found


def apart(values: Floats, among: NDArray[np.bool_]) -> Floats:
    """Return the range (maximum minus minimum) of the values of the robots `among`, per sample.

    The range is nan while one of these robots has no value."""
    found = np.full(len(values), np.nan)
    for sample, (numbers, chosen) in enumerate(zip(values, among, strict=True)):
        if chosen.any():
            found[sample] = numbers[chosen].max() - numbers[chosen].min()
    return found


def settled_at(series: MetricSeries, holds: NDArray[np.bool_]) -> float:
    """Return the time in s from which `holds` is true until the end; nan if it is false at the end."""
    wrong = np.flatnonzero(~holds[: len(series.times)])
    first = int(wrong[-1]) + 1 if len(wrong) else 0
    return float(series.times[first]) if first < len(series.times) else float("nan")
