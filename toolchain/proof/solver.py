"""Queries to the z3 solver: satisfiability and validity of conditions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import z3

from toolchain.proof.terms import Term

WORK: Final = 12_000_000
"""Resource limit (rlimit) of one query, a few seconds; unlike a time limit it is reproducible."""
ALL_WORK: Final = 10 * WORK
"""Resource limit of all queries about one function."""


class Undecided(Exception):
    """There is neither a proof nor a counterexample; the message gives the reason."""


class Refuted(Exception):
    """Code and IR differ for every input that satisfies `conditions`; None: the conditions of the path."""

    def __init__(self, what: str, conditions: Sequence[Term] | None = None) -> None:
        super().__init__(what)
        self.what = what
        self.conditions = conditions


class _Budget:
    """Remaining solver budget of the current function."""

    def __init__(self) -> None:
        self.left = ALL_WORK

        self._count = 0

    def begin(self, share: int = 1) -> None:
        """Reset the budget for a function, or to 1/`share` of it for a part of one."""
        self.left = ALL_WORK // share

    def spend(self, statistics: z3.Statistics) -> None:
        """Charge the work since the last query; z3's counter is cumulative."""
        names = statistics.keys()
        count = int(statistics.get_key_value("rlimit count")) if "rlimit count" in names else self._count
        self.left -= max(0, count - self._count)
        self._count = count


budget: Final = _Budget()


def check(conditions: Sequence[Term]) -> tuple[z3.CheckSatResult, z3.Solver]:
    """Return whether the conditions are satisfiable, and the solver; raises Undecided if the budget is exhausted."""
    if budget.left <= 0:
        raise Undecided("the solver budget of the function is exhausted")
    solver = z3.SolverFor("QF_AUFBV")
    solver.set("rlimit", WORK)
    solver.add(*conditions)
    found = solver.check()
    budget.spend(solver.statistics())
    return found, solver


def feasible(conditions: Sequence[Term]) -> bool:
    """Whether the conditions are satisfiable; True if the solver gives up."""
    return bool(check(conditions)[0] != z3.unsat)


def require(goal: Term, given: Sequence[Term], what: str) -> None:
    """Check that `goal` follows from `given`; raises Refuted if it does not, Undecided if the solver gives up."""
    if z3.is_true(z3.simplify(goal)):
        return
    conditions = [*given, z3.Not(goal)]
    found, _ = check(conditions)
    if found == z3.sat:
        raise Refuted(what, conditions)
    if found != z3.unsat:
        raise Undecided(f"the solver gave up: {what}")


def find_model(conditions: Sequence[Term], preferred: Sequence[Term]) -> z3.ModelRef | None:
    """Return a model of the conditions that satisfies the preferences greedily in order, None without one."""
    kept = list(conditions)
    found, solver = check(kept)
    model = solver.model() if found == z3.sat else None
    for preference in preferred:
        if model is None:
            return None
        found, solver = check([*kept, preference])
        if found == z3.sat:
            kept.append(preference)
            model = solver.model()
    return model
