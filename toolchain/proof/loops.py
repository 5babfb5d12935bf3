"""Loops whose rounds the input decides, by induction.

Whenever the source comes to the first block of a loop, the code comes to one address, and registers and words of the
frame hold certain values of the source. Which is guessed from a few ways through the function, with inputs by chance
(`claims.py`); what one more round does not keep is dropped, until the claims that are left prove each other. With them
each stretch, from the beginning or a loop's first block to the next one or the end, is proved as a function without
loops is, whatever the source's values are at its beginning.

An induction that fails refutes nothing: it may want another claim.
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
from toolchain.proof.code.code import Code
from toolchain.proof.code.machine import State
from toolchain.proof.invariants import Claim, Order, guessed, orders, parts_of
from toolchain.proof.ir.source import Evaluator
from toolchain.proof.memory import BYTE, Frame, Memory, joined, split
from toolchain.proof.path import Path
from toolchain.proof.problem import WORD_UNITS, Subject
from toolchain.proof.solver import Refuted, Undecided, answer, budget, example, feasible
from toolchain.proof.terms import Term, narrow, vector

WAYS: Final = 8
"""Ways through the function that claims are guessed from,"""
ROUNDS: Final = 3
"""and how often one of them decides whether to go round a loop again."""
MOST_TRIES: Final = 6
"""Blocks and addresses of loops that are tried,"""
SHARE: Final = 6
"""and the part of a function's work that each gets."""
MOST_PASSES: Final = 12
MOST_PASSED: Final = 3
"""Times the machine may be where a loop begins while the source is not there."""
WISHES: Final = 6
"""Registers at entry that an input has by chance if it can, one by one; the others so together."""
SEED: Final = 30


@dataclass
class Head:
    """The first block of a loop: what is known of the machine whenever the source comes to it."""

    name: str
    pc: int
    top: int
    """W15."""
    claims: list[Claim]
    orders: list[Order]
    places: set[int]
    """Bytes of the frame that may have been written."""


@dataclass
class Way:
    """One way through the function, for one input: the source at loops, the machine at every instruction."""

    path: Path
    states: list[State]
    model: z3.ModelRef

    def meetings(self, name: str, pc: int) -> list[tuple[dict[int, Any], State]] | None:
        """Values and states each time the source is at a block and the machine at an address; None where they do not
        come there equally often, with as many events behind them."""
        source = [(values, events) for head, values, events in self.path.heads if head == name]
        machine = [state for state in self.states if state.pc == pc]
        if [events for _, events in source] != [state.event for state in machine]:
            return None
        return [(values, state) for (values, _), state in zip(source, machine, strict=True)]

    def number(self, term: Term) -> int:
        """What a term is for this input."""
        return int(self.model.eval(term, model_completion=True).as_long())


class Induction:
    """One function. `start` is the machine at its beginning, `begin` makes a path there, `code` the machine for one."""

    def __init__(
        self, subject: Subject, f: Function, frame: Frame, start: State, begin: Callable[[], Path],
        code: Callable[[Path], Code], volatile: Set[int],
    ) -> None:  # fmt: skip
        self.subject: Final = subject
        self.frame: Final = frame
        self.start: Final = start
        self.begin: Final = begin
        self.code: Final = code
        self.volatile: Final = volatile
        self.f: Final = f
        self.registers: Final = start.w[:SP]
        self.entry: Final[dict[Any, Any]] = {("W", n): (term, None) for n, term in enumerate(self.registers)}
        """Values beside those of the source: registers as they were."""
        self.blocks: Final = {b.name: b for b in reverse_postorder(f)}
        self.above: Final = {name: self._dominators(name) for name in self.blocks}
        before = predecessors(f)
        self.cuts: Final = [self._passed(n, [p for p in before[n] if n in self.above.get(p, ())]) for n in self.blocks]
        """Of each block that begins a loop those that every round of it comes through, of others none."""
        self.paths = 0
        self._changed = False
        self._places: Set[int] = frozenset()
        """Where the machine is at loops."""

    def _reached(self, first: str, without: str = "") -> set[str]:
        """Blocks that one leads to, itself among them, but by way of another."""
        seen, work = {without}, [first]
        while work:
            one = work.pop()
            if one not in seen:
                seen.add(one)
                work += self.blocks[one].succs
        return seen - {without}

    def _dominators(self, name: str) -> set[str]:
        """Blocks that every way to this one comes through, itself among them."""
        first = next(iter(self.blocks))
        return {other for other in self.blocks if name not in self._reached(first, other)}

    def _passed(self, name: str, ends: list[str]) -> list[str]:
        return [other for other in self.blocks if ends and name in self.above[other]
                and all(other in self.above[end] for end in ends)]  # fmt: skip

    def prove(self, otherwise: Undecided) -> None:
        """Raises `otherwise` where no induction succeeds; Refuted where a way with few rounds shows it."""
        try:
            ways = list(islice(self._ways(), WAYS))
        except Undecided:
            raise otherwise from None
        loops = [[(n, pc) for n in cuts for pc in self._addresses(n, ways)] for cuts in self.cuts if cuts]
        for places, ordered in product(islice(product(*loops), MOST_TRIES), (False, True)):
            budget.begin(SHARE)
            with suppress(Refuted, Undecided):
                self._induct({name: self._guessed(name, pc, ways, ordered) for name, pc in places})
                return
        raise otherwise

    # -- what may hold -----------------------------------------------------------------------------------------------

    def _ways(self) -> Iterator[Way]:
        chance = random.Random(SEED)
        watched = frozenset(name for cuts in self.cuts for name in cuts)
        for path in Evaluator(self.f, self.frame, self.subject.address, watched).paths(self.begin(), most=ROUNDS):
            if not path.heads or not feasible(path.known):
                continue
            code = self.code(path)
            code.watched = frozenset(range(code.start, code.end))
            try:
                ended = code.run(self.registers, self.start.copy(), self.volatile)
            except Undecided:  # one way through it may be harder than a round, and serves as well up to there
                ended = [code.state] if code.state.event == len(path.events) else []
            for state in ended:
                wishes = [register == chance.randrange(1 << 16) for register in self.registers]
                wishes = [*wishes[:WISHES], z3.And(*wishes[WISHES:])]
                model = example([*path.known, *state.path], [*path.preferred, *wishes])
                if model is not None:
                    yield Way(path, state.trace, model)

    def _addresses(self, name: str, ways: list[Way]) -> list[int]:
        """Where the machine jumps to, and is whenever the source is at a block, and only then."""
        landed: dict[int, None] = {}
        for way in ways:
            for one, following in pairwise(way.states):
                insn = self.subject.insn(one.pc)
                if insn is not None and following.pc != one.pc + WORD_UNITS * insn.words:
                    landed[following.pc] = None
        return [pc for pc in landed if all(way.meetings(name, pc) is not None for way in ways)]

    def _guessed(self, name: str, pc: int, ways: list[Way], ordered: bool) -> Head:
        """What may hold there; `ordered`: of the source's values, too."""
        met = [(way, self._values(values), state) for way in ways for values, state in way.meetings(name, pc) or ()]
        states = [state for _, _, state in met]
        if not states or len({state.w[SP] for state in states}) > 1:
            raise Undecided("the source comes to a loop on no way that was tried")
        top = states[0].w[SP]
        places = {at for state in states for at in state.frame if at < top}
        words = [at for at in places if at % 2 == 0 and all(at in s.frame and at + 1 in s.frame for s in states)]
        sizes = {part: bits for key in self._keys(name) for part, bits in parts_of(key, met[0][1][key])}
        rows = [{part: way.number(part.term(values)) for part in sizes} for way, values, _ in met]
        own = [{part: number for part, number in row.items() if part.key not in self.entry} for row in rows]
        head = Head(name, pc, top, [], list(orders(own, sizes)) if ordered else [], places)
        for place in [*range(SP), *sorted(words)]:
            head.claims += guessed(place, [way.number(_held(state, place)) for way, _, state in met], rows, sizes)
        return head

    def _values(self, own: dict[int, Any]) -> dict[Any, Any]:
        return {**own, **self.entry}

    def _keys(self, name: str) -> list[Any]:
        """Values that the block and those behind it use, or that these are made of, and registers at entry."""
        behind, above = self._reached(name), self.above[name] - {name}
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

    # -- what does hold ----------------------------------------------------------------------------------------------

    def _induct(self, heads: dict[str, Head]) -> None:
        """Raises Refuted, Undecided."""
        self._places = {head.pc for head in heads.values()}
        for _ in range(MOST_PASSES):
            self._changed, self.paths = False, 0
            for head in (None, *heads.values()):
                self._stretch(head, heads)
            if not self._changed:
                return
        raise Undecided("claims that do not end")

    def _stretch(self, head: Head | None, heads: dict[str, Head]) -> None:
        """From the beginning, or a loop's first block, to wherever the source ends or comes to one."""
        evaluator = Evaluator(self.f, self.frame, self.subject.address)
        path = self.begin() if head is None else self._resumed(evaluator, head)
        state = self.start if head is None else self._state(head, path)
        for one in evaluator.paths(path, "" if head is None else head.name, frozenset(heads)):
            if feasible(one.known):
                self.paths += 1
                code = self.code(one)
                arrived = partial(self._arrived, code, heads.get(one.head))
                code.run(self.registers, state.copy(), self.volatile, arrived, moved=head is None)

    def _resumed(self, evaluator: Evaluator, head: Head) -> Path:
        """The source at a loop's first block: what was read or given before is anything, and so are phis and memory."""
        path = self.begin()
        path.memory = Memory(z3.Array("memory.loop", z3.BitVecSort(16), z3.BitVecSort(BYTE)))
        path.behind_barrier = True  # as if: nothing may be moved over it then
        for name, block in self.blocks.items():
            if name in self.above[head.name]:
                for i in block.phis() if name == head.name else block.instrs:
                    evaluator.again(path, i)
        return path

    def _state(self, head: Head, path: Path) -> State:
        """The machine there, of which only the claims are known."""
        values = self._values(path.values)
        w = [z3.FreshConst(z3.BitVecSort(16), f"W{n}") for n in range(SP)]
        state = State([*w, head.top], path.memory.copy(), head.pc, top=head.top)
        state.frame = {at: z3.FreshConst(z3.BitVecSort(BYTE), "stack") for at in head.places}
        state.forget_flags()
        state.regs["RCOUNT"] = narrow(z3.FreshConst(z3.BitVecSort(16), "RCOUNT"))
        told: set[int] = set()
        for claim in head.claims:
            if claim.place not in told and claim.bits == 16 and claim.poison(values) is None:
                told.add(claim.place)
                if claim.place < SP:
                    state.w[claim.place] = claim.term(values)
                else:
                    state.frame[claim.place], state.frame[claim.place + 1] = split(claim.term(values))
        state.path = [claim.holds(_held(state, claim.place), values) for claim in head.claims]
        path.assumed += [order.holds(values) for order in head.orders]
        return state

    def _arrived(self, code: Code, head: Head | None, state: State) -> bool:
        """Whether the code has come to where the source is, a loop's first block; what must hold there does then, or
        claims are dropped."""
        if head is None or state.pc != head.pc or state.event != len(code.path.events) or state.done:
            state.trace += [state] if state.pc in self._places else []
            if len(state.trace) > MOST_PASSED:
                raise Undecided("goes round where the source does not")
            return False
        if state.w[SP] != head.top:
            raise Undecided("W15 differs at a loop")
        machine = code.machine
        code.contract.loop(state)
        values = self._values(code.path.values)
        told = [c.holds(_held(state, c.place), values) for c in head.claims] + [o.holds(values) for o in head.orders]
        true = _proved(machine.given, told)
        claims = [c for c, one in zip(head.claims, true, strict=False) if one]
        ordered = [o for o, one in zip(head.orders, true[len(head.claims) :], strict=True) if one]
        written = {at for at in state.frame if at < head.top}
        self._changed |= (claims, ordered) != (head.claims, head.orders) or not written <= head.places
        head.claims, head.orders, head.places = claims, ordered, head.places | written
        return True


def _proved(given: list[Term], claims: list[Term]) -> list[bool]:
    """Which of some claims hold whenever `given` does."""
    left = {n: claim for n, claim in enumerate(claims) if not z3.is_true(z3.simplify(claim))}
    gone: set[int] = set()
    while left:
        found, solver = answer([*given, z3.Not(z3.And(*left.values()))])
        if found == z3.unsat:
            break
        model = solver.model() if found == z3.sat else None
        wrong = {n for n, c in left.items() if model is not None and z3.is_false(model.eval(c, model_completion=True))}
        if not wrong:
            gone |= {n for n, claim in left.items() if answer([*given, z3.Not(claim)])[0] != z3.unsat}
            break
        gone |= wrong
        left = {n: claim for n, claim in left.items() if n not in wrong}
    return [n not in gone for n in range(len(claims))]


def _held(state: State, place: int) -> Term:
    """A register, or a word of the frame."""
    if place < SP:
        held = state.w[place]
        return vector(held, 16) if isinstance(held, int) else held
    return joined([state.frame.get(place + k, z3.BitVec(f"stack.{place + k:x}", BYTE)) for k in (0, 1)])
