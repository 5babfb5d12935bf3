"""Synchronised blinking: how far apart in time Kilobots blink."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, TrialSamples

TICK_S = 0.032768
PERIOD_S = 50 * TICK_S
"""Time from one blink to the next in firmware/kilobot/programs/synchronise.c."""
TOGETHER_TICKS = 7.0

CURVES = [
    Curve("spread", "shortest time that has a blink of each robot", "ticks"),
    Curve("blinks", "blinks of a robot, mean"),
]
MEASURES = [
    Measure("spread", "spread of the blinks at {at:g} s, ticks", lambda series, at: series.at(at, "spread")),
    Measure("together", f"s until all blink within {TOGETHER_TICKS:g} ticks",
            lambda series, at: _first_below(series.times, series.curves["spread"], at)),
]  # fmt: skip


def _first_below(times: Floats, spread: Floats, until: float) -> float:
    """Return the first time from which the spread stays within TOGETHER_TICKS up to `until`; nan if there is none."""
    known = times <= until
    late = np.flatnonzero(~(spread[known] <= TOGETHER_TICKS))
    first = late[-1] + 1 if len(late) else 0
    return float(times[known][first]) if first < known.sum() else float("nan")


def _spread(phases: Floats) -> float:
    """Return the length of the shortest arc that has all phases, in s; PERIOD_S is the whole circle."""
    ordered = np.sort(phases % PERIOD_S)
    return float(PERIOD_S - np.diff(ordered, append=ordered[0] + PERIOD_S).max())


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return both metrics, from the last blink of each robot; nan before each robot has blinked."""
    count = samples.robots.shape[1]
    last, blinks, changes = np.full(count, np.nan), np.zeros(count), iter(samples.led_changes)
    spread, counted, change = [], [], next(changes, None)
    for time in samples.times:
        while change is not None and change.seconds <= time:
            if change.leds:
                last[change.robot] = change.seconds
                blinks[change.robot] += 1
            change = next(changes, None)
        spread.append(_spread(last) / TICK_S)
        counted.append(float(blinks.mean()))
    return {"spread": np.array(spread), "blinks": np.array(counted)}
