"""Statistics of outcomes with Wilson intervals (scipy)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any, Final

from emu.inject.faults import KINDS
from emu.inject.trial import OUTCOMES, Outcome

CONFIDENCE: Final = 0.95


def summary(outcomes: Iterable[Outcome]) -> dict[str, dict[str, Any]]:
    """Return the statistics by fault kind, and for all kinds under "all".

    They contain the number of trials and, for every outcome, its count, share and 95 % Wilson interval. Raises
    ImportError without scipy.
    """
    from scipy.stats import binomtest

    counts: dict[str, Counter[str]] = {kind: Counter() for kind in (*KINDS, "all")}
    for one in outcomes:
        counts[one.kind][one.outcome] += 1
        counts["all"][one.outcome] += 1
    found: dict[str, dict[str, Any]] = {}
    for kind, by_outcome in counts.items():
        trials = by_outcome.total()
        if not trials:
            continue
        found[kind] = {"trials": trials}
        for outcome in OUTCOMES:
            interval = binomtest(by_outcome[outcome], trials).proportion_ci(CONFIDENCE, method="wilson")
            found[kind][outcome] = {
                "number": by_outcome[outcome],
                "share": by_outcome[outcome] / trials,
                "low": float(interval.low),
                "high": float(interval.high),
            }
    return found


def lines(found: dict[str, dict[str, Any]]) -> list[str]:
    """Return the statistics as a table in percent, with intervals."""
    rows = [f"{'':10} {'trials':>6} " + " ".join(f"{outcome:>22}" for outcome in OUTCOMES)]
    for kind, facts in found.items():
        shares = (
            f"{100 * one['share']:6.2f} % [{100 * one['low']:5.2f}, {100 * one['high']:5.2f}]"
            for one in (facts[outcome] for outcome in OUTCOMES)
        )
        rows.append(f"{kind:10} {facts['trials']:6} " + " ".join(f"{share:>22}" for share in shares))
    return rows
