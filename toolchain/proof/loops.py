"""Proof by induction of loops with input-dependent iteration counts.

An invariant holds whenever the source is at a loop head.  One states the address at which the code then is; the others
state which registers and frame words hold which values of the source.  Sample runs with random inputs give candidates
(`invariants.py`).  Candidates that an iteration does not preserve are dropped until the others are inductive.  With the
invariants, each segment from the entry or a loop head to the next loop head or return is proved like a function without
loops.

A failed induction does not refute the function: a necessary invariant may be missing.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Set
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice, pairwise, product
from typing import Any, Final

import z3

from toolchain.abi.target import SP
from toolchain.ir.cfg import predecessors, reverse_postorder
from toolchain.ir.model import Function
from toolchain.proof.invariants import Invariant, OrderInvariant, candidate_invariants, candidate_orders, words_of
from toolchain.proof.ir.evaluator import Evaluator
from toolchain.proof.machine_code.execution import CodeExecution
from toolchain.proof.machine_code.machine import MachineState
from toolchain.proof.memory import BYTE, StackFrame, SymbolicMemory, bytes_of, concat
from toolchain.proof.path import Path
from toolchain.proof.problem import WORD_UNITS, CompiledFile
from toolchain.proof.solver import Refuted, Undecided, budget, check, feasible, find_model
from toolchain.proof.terms import Term, narrow, vector

MAX_RUNS: Final = 8
"""Greatest number of sample runs from which candidates are derived."""
MAX_RUN_FORKS: Final = 3
"""Greatest number of input-dependent branches of one block in a sample run."""
MAX_ATTEMPTS: Final = 6
"""Greatest number of assignments of addresses to loop heads that are tried."""
SHARE: Final = 6
"""Fraction (1/SHARE) of a function's solver budget for each attempt."""
MAX_PASSES: Final = 12
MAX_EXTRA_VISITS: Final = 3
"""Greatest number of times the machine passes a loop-head address while the source is not at a loop head."""
RANDOM_REGISTERS: Final = 6
"""Number of entry registers that receive random values one by one, if feasible; the others receive them together."""
SEED: Final = 30


@dataclass
class LoopHead:
    """A loop head of the source, and the machine state whenever the source is there."""

    name: str
    pc: int
    top: int
    """W15 at the loop head."""
    invariants: list[Invariant]
    orders: list[OrderInvariant]
    places: set[int]
    """Addresses of frame bytes that may have been written."""


@dataclass
class SampleRun:
    """A run of the function with one input: source values at loop heads, machine states at all instructions."""

    path: Path
    states: list[MachineState]
    model: z3.ModelRef

    def visits_of(self, name: str, pc: int) -> list[tuple[dict[int, Any], MachineState]] | None:
        """Return source values and machine state at each visit of a block and an address.

        None if the visits differ in number or in the number of preceding events.
        """
        source = [(values, events) for head, values, events in self.path.loop_visits if head == name]
        machine = [state for state in self.states if state.pc == pc]
        if [events for _, events in source] != [state.event for state in machine]:
            return None
        return [(values, state) for (values, _), state in zip(source, machine, strict=True)]

    def number(self, term: Term) -> int:
        """Return the value of a term for this input."""
        return int(self.model.eval(term, model_completion=True).as_long())


class Induction:
    """Proof by induction of one function.

    start  machine state at the entry
    begin  creates a path at the entry
    code   creates the symbolic execution for a path
    """

    def __init__(
        self, compiled: CompiledFile, f: Function, frame: StackFrame, start: MachineState, begin: Callable[[], Path],
        code: Callable[[Path], CodeExecution], volatile: Set[int],
    ) -> None:  # fmt: skip
        self.compiled: Final = compiled
        self.frame: Final = frame
        self.start: Final = start
        self.begin: Final = begin
        self.code: Final = code
        self.volatile: Final = volatile
        self.f: Final = f
        self.registers: Final = start.w[:SP]
        self.entry: Final[dict[Any, Any]] = {("W", n): (term, None) for n, term in enumerate(self.registers)}
        """Values for invariants in addition to those of the source: registers at entry."""
        self.blocks: Final = {b.name: b for b in reverse_postorder(f)}
        self.dominators: Final = {name: self._dominators(name) for name in self.blocks}
        before = predecessors(f)
        self.loop_cuts: Final = [
            self._passed_by_all(n, [p for p in before[n] if n in self.dominators.get(p, ())]) for n in self.blocks
        ]
        """By block: for a loop head, the blocks that every iteration passes, else none."""
        self.paths = 0
        self._changed = False
        self._places: Set[int] = frozenset()
        """Addresses of the machine at loop heads."""

    def _reached(self, first: str, without: str = "") -> set[str]:
        """Return the blocks reachable from `first`, including itself, on paths that avoid the block `without`."""
        seen, work = {without}, [first]
        while work:
            one = work.pop()
            if one not in seen:
                seen.add(one)
                work += self.blocks[one].succs
        return seen - {without}

    def _dominators(self, name: str) -> set[str]:
        """Return the dominators of a block, including itself."""
        first = next(iter(self.blocks))
        return {other for other in self.blocks if name not in self._reached(first, other)}

    def _passed_by_all(self, name: str, ends: list[str]) -> list[str]:
        return [other for other in self.blocks if ends and name in self.dominators[other]
                and all(other in self.dominators[end] for end in ends)]  # fmt: skip

    def prove(self, failure: Undecided) -> None:
        """Prove the function; raises `failure` if no induction succeeds, Refuted if a sample run refutes it."""
        try:
            runs = list(islice(self._sample_runs(), MAX_RUNS))
        except Undecided:
            raise failure from None
        loops = [[(n, pc) for n in cuts for pc in self._addresses(n, runs)] for cuts in self.loop_cuts if cuts]
        for places, ordered in product(islice(product(*loops), MAX_ATTEMPTS), (False, True)):
            budget.begin(SHARE)
            with suppress(Refuted, Undecided):
                self._induct({name: self._candidate_head(name, pc, runs, ordered) for name, pc in places})
                return
        raise failure

    # -- candidates --------------------------------------------------------------------------------------------------

    def _sample_runs(self) -> Iterator[SampleRun]:
        chance = random.Random(SEED)
        watched = frozenset(name for cuts in self.loop_cuts for name in cuts)
        for path in Evaluator(self.f, self.frame, self.compiled.address, watched).paths(
            self.begin(), most=MAX_RUN_FORKS
        ):
            if not path.loop_visits or not feasible(path.conditions):
                continue
            code = self.code(path)
            code.watched = frozenset(range(code.start, code.end))
            try:
                ended = code.run(self.registers, self.start.copy(), self.volatile)
            except Undecided:  # an incomplete run is a usable sample
                ended = [code.state] if code.state.event == len(path.events) else []
            for state in ended:
                preferences = [register == chance.randrange(1 << 16) for register in self.registers]
                preferences = [*preferences[:RANDOM_REGISTERS], z3.And(*preferences[RANDOM_REGISTERS:])]
                model = find_model([*path.conditions, *state.path], [*path.preferences, *preferences])
                if model is not None:
                    yield SampleRun(path, state.trace, model)

    def _addresses(self, name: str, runs: list[SampleRun]) -> list[int]:
        """Return jump targets that the machine visits exactly when the source visits a block."""
        landed: dict[int, None] = {}
        for run in runs:
            for one, following in pairwise(run.states):
                insn = self.compiled.insn(one.pc)
                if insn is not None and following.pc != one.pc + WORD_UNITS * insn.words:
                    landed[following.pc] = None
        return [pc for pc in landed if all(run.visits_of(name, pc) is not None for run in runs)]

    def _candidate_head(self, name: str, pc: int, runs: list[SampleRun], ordered: bool) -> LoopHead:
        """Return a loop head with its candidate invariants; `ordered`: include orders between source values."""
        met = [(run, self._values(values), state) for run in runs for values, state in run.visits_of(name, pc) or ()]
        states = [state for _, _, state in met]
        if not states or len({state.w[SP] for state in states}) > 1:
            raise Undecided("no sample run visits a loop head")
        top = states[0].w[SP]
        places = {at for state in states for at in state.frame if at < top}
        words = [at for at in places if at % 2 == 0 and all(at in s.frame and at + 1 in s.frame for s in states)]
        sizes = {part: bits for key in self._keys(name) for part, bits in words_of(key, met[0][1][key])}
        rows = [{part: run.number(part.term(values)) for part in sizes} for run, values, _ in met]
        own = [{part: number for part, number in row.items() if part.key not in self.entry} for row in rows]
        head = LoopHead(name, pc, top, [], list(candidate_orders(own, sizes)) if ordered else [], places)
        for place in [*range(SP), *sorted(words)]:
            head.invariants += candidate_invariants(
                place, [run.number(_contents(state, place)) for run, _, state in met], rows, sizes
            )
        return head

    def _values(self, own: dict[int, Any]) -> dict[Any, Any]:
        return {**own, **self.entry}

    def _keys(self, name: str) -> list[Any]:
        """Return the values that a block and its successors depend on, and registers at entry."""
        behind, above = self._reached(name), self.dominators[name] - {name}
        work = [a for b in self.blocks if b in behind for i in self.blocks[b].instrs for a in i.args]
        made = {id(i): i for b in self.blocks if b in above for i in self.blocks[b].instrs}
        own = {id(phi) for phi in self.blocks[name].phis()} | {id(a) for a in self.f.args} | set(made)
        found: dict[Any, None] = {}
        while work:
            value = work.pop()
            if id(value) in own and id(value) not in found and value.type.kind in ("int", "ptr", "float"):
                found[id(value)] = None
                work += made[id(value)].args if id(value) in made else []
        return [*found, *self.entry]

    # -- induction ---------------------------------------------------------------------------------------------------

    def _induct(self, heads: dict[str, LoopHead]) -> None:
        """Drop invariants that are not inductive and prove all segments; raises Refuted, Undecided."""
        self._places = {head.pc for head in heads.values()}
        for _ in range(MAX_PASSES):
            self._changed, self.paths = False, 0
            for head in (None, *heads.values()):
                self._prove_segment(head, heads)
            if not self._changed:
                return
        raise Undecided("invariants that reach no fixpoint")

    def _prove_segment(self, head: LoopHead | None, heads: dict[str, LoopHead]) -> None:
        """Prove a segment: from the entry or a loop head to the next loop head or return."""
        evaluator = Evaluator(self.f, self.frame, self.compiled.address)
        path = self.begin() if head is None else self._path_at(evaluator, head)
        state = self.start if head is None else self._state_at(head, path)
        for one in evaluator.paths(path, "" if head is None else head.name, frozenset(heads)):
            if feasible(one.conditions):
                self.paths += 1
                code = self.code(one)
                at_end = partial(self._at_loop_head, code, heads.get(one.head))
                code.run(self.registers, state.copy(), self.volatile, at_end, moved=head is None)

    def _path_at(self, evaluator: Evaluator, head: LoopHead) -> Path:
        """Return a path at a loop head: phis, memory, and earlier loads and call results are unknown."""
        path = self.begin()
        path.memory = SymbolicMemory(z3.Array("memory.loop", z3.BitVecSort(16), z3.BitVecSort(BYTE)))
        path.behind_barrier = True  # conservative: no store may cross the loop head
        for name, block in self.blocks.items():
            if name in self.dominators[head.name]:
                for i in block.phis() if name == head.name else block.instrs:
                    evaluator.assign_before(path, i)
        return path

    def _state_at(self, head: LoopHead, path: Path) -> MachineState:
        """Return the machine state at a loop head, of which only the invariants are known."""
        values = self._values(path.values)
        w = [z3.FreshConst(z3.BitVecSort(16), f"W{n}") for n in range(SP)]
        state = MachineState([*w, head.top], path.memory.copy(), head.pc, top=head.top)
        state.frame = {at: z3.FreshConst(z3.BitVecSort(BYTE), "stack") for at in head.places}
        state.forget_flags()
        state.regs["RCOUNT"] = narrow(z3.FreshConst(z3.BitVecSort(16), "RCOUNT"))
        known_places: set[int] = set()
        for invariant in head.invariants:
            if invariant.place not in known_places and invariant.bits == 16 and invariant.poison(values) is None:
                known_places.add(invariant.place)
                if invariant.place < SP:
                    state.w[invariant.place] = invariant.term(values)
                else:
                    state.frame[invariant.place], state.frame[invariant.place + 1] = bytes_of(invariant.term(values))
        state.path = [invariant.holds(_contents(state, invariant.place), values) for invariant in head.invariants]
        path.assumptions += [order.holds(values) for order in head.orders]
        return state

    def _at_loop_head(self, code: CodeExecution, head: LoopHead | None, state: MachineState) -> bool:
        """Whether the code is at the loop head where the source's path ends.

        If so, check the state there and drop the invariants that do not hold.
        """
        if head is None or state.pc != head.pc or state.event != len(code.path.events) or state.accessed_bytes:
            state.trace += [state] if state.pc in self._places else []
            if len(state.trace) > MAX_EXTRA_VISITS:
                raise Undecided("iterates where the source does not")
            return False
        if state.w[SP] != head.top:
            raise Undecided("W15 differs at a loop")
        machine = code.machine
        code.convention.check_loop_head(state)
        values = self._values(code.path.values)
        goals = [c.holds(_contents(state, c.place), values) for c in head.invariants] + [
            o.holds(values) for o in head.orders
        ]
        true = _implied(machine.conditions, goals)
        invariants = [c for c, one in zip(head.invariants, true, strict=False) if one]
        ordered = [o for o, one in zip(head.orders, true[len(head.invariants) :], strict=True) if one]
        written = {at for at in state.frame if at < head.top}
        self._changed |= (invariants, ordered) != (head.invariants, head.orders) or not written <= head.places
        head.invariants, head.orders, head.places = invariants, ordered, head.places | written
        return True


def _implied(given: list[Term], goals: list[Term]) -> list[bool]:
    """Return which of the goals follow from the conditions `given`."""
    left = {n: goal for n, goal in enumerate(goals) if not z3.is_true(z3.simplify(goal))}
    gone: set[int] = set()
    while left:
        found, solver = check([*given, z3.Not(z3.And(*left.values()))])
        if found == z3.unsat:
            break
        model = solver.model() if found == z3.sat else None
        wrong = {n for n, c in left.items() if model is not None and z3.is_false(model.eval(c, model_completion=True))}
        if not wrong:
            gone |= {n for n, goal in left.items() if check([*given, z3.Not(goal)])[0] != z3.unsat}
            break
        gone |= wrong
        left = {n: goal for n, goal in left.items() if n not in wrong}
    return [n not in gone for n in range(len(goals))]


def _contents(state: MachineState, place: int) -> Term:
    """Return the contents of a register or a frame word."""
    if place < SP:
        held = state.w[place]
        return vector(held, 16) if isinstance(held, int) else held
    return concat([state.frame.get(place + k, z3.BitVec(f"stack.{place + k:x}", BYTE)) for k in (0, 1)])
