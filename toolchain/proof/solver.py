"""Questions to z3: whether something can be, and whether something must be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import z3

from toolchain.proof.terms import Term

WORK: Final = 12_000_000
"""z3's units of work for one question, some seconds: the same question has the same answer on every machine."""
ALL_WORK: Final = 10 * WORK
"""For all that is asked about one function."""


class Undecided(Exception):
    """There is no proof and no counterexample; says why."""


class Refuted(Exception):
    """Code and IR differ for every input that meets `conditions`; None: for what the path in question holds."""

    def __init__(self, what: str, conditions: Sequence[Term] | None = None) -> None:
        super().__init__(what)
        self.what = what
        self.conditions = conditions


class _Budget:
    """Work that is left for the function that is looked at."""

    def __init__(self) -> None:
        self.left = ALL_WORK

        self._count = 0

    def begin(self, share: int = 1) -> None:
        """A new function, or a part of one that gets so much less."""
        self.left = ALL_WORK // share

    def spend(self, told: z3.Statistics) -> None:
        """What z3 tells after a question: the count of all questions so far."""
        names = told.keys()
        count = int(told.get_key_value("rlimit count")) if "rlimit count" in names else self._count
        self.left -= max(0, count - self._count)
        self._count = count


budget: Final = _Budget()


def answer(conditions: Sequence[Term]) -> tuple[z3.CheckSatResult, z3.Solver]:
    """Whether some input meets all of them, and the solver that knows. Raises Undecided when too much was asked."""
    if budget.left <= 0:
        raise Undecided("more work for the solver than a function gets")
    solver = z3.SolverFor("QF_AUFBV")
    solver.set("rlimit", WORK)
    solver.add(*conditions)
    found = solver.check()
    budget.spend(solver.statistics())
    return found, solver


def feasible(conditions: Sequence[Term]) -> bool:
    """Whether some input meets all of them; True where the solver does not know."""
    return bool(answer(conditions)[0] != z3.unsat)


def demand(claim: Term, given: Sequence[Term], what: str) -> None:
    """Raises Refuted where some input makes `claim` false, Undecided where the solver gives up."""
    if z3.is_true(z3.simplify(claim)):
        return
    conditions = [*given, z3.Not(claim)]
    found, _ = answer(conditions)
    if found == z3.sat:
        raise Refuted(what, conditions)
    if found != z3.unsat:
        raise Undecided(f"the solver gave up: {what}")


def example(conditions: Sequence[Term], preferred: Sequence[Term]) -> z3.ModelRef | None:
    """An input that meets all conditions and as many of the preferences as come, one after the other."""
    kept = list(conditions)
    found, solver = answer(kept)
    model = solver.model() if found == z3.sat else None
    for wish in preferred:
        if model is None:
            return None
        found, solver = answer([*kept, wish])
        if found == z3.sat:
            kept.append(wish)
            model = solver.model()
    return model
