"""Does the machine code of a function do what its IR says? Every path of the IR against every path of the code.

For each path of the IR that some input takes, the code runs from its first instruction with what holds on that path.
It must show the world the same, in order, give back the same, leave the same in memory, and keep W8-W14, W15 and its
return address (abi-elf.md §2.1).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import z3

from toolchain.abi.arguments import Place
from toolchain.abi.names import symbol
from toolchain.abi.target import RETURN_ADDRESS_BYTES
from toolchain.ir.cfg import loop_depths
from toolchain.ir.model import Arg, ConstInt, Function, Instr, Type, size_of
from toolchain.proof.code.code import Code
from toolchain.proof.code.machine import State
from toolchain.proof.counterexample import Witness, witness_of
from toolchain.proof.ir.accesses import Accesses
from toolchain.proof.ir.source import Evaluator
from toolchain.proof.loops import Induction
from toolchain.proof.memory import STACK, Frame, Memory, joined
from toolchain.proof.path import Path
from toolchain.proof.problem import Subject
from toolchain.proof.solver import Refuted, Undecided, budget, example, feasible
from toolchain.proof.terms import Term
from toolchain.select.calls import parameter_places


@dataclass(frozen=True)
class Verdict:
    """Of one function: proved, refuted or undecided, and why. `loops`: whether its IR has one."""

    function: str
    kind: str
    why: str = ""
    loops: bool = False
    paths: int = 0
    witness: Witness | None = None
    """Of a refutation: the input that shows it, where what differs depends on one."""


def verdicts(subject: Subject, only: str | None = None) -> Iterator[Verdict]:
    """Of every function the file defines."""
    for f in subject.module.functions.values():
        if f.blocks and f.linkage != "available_externally" and only in (None, f.name):
            yield Proof(subject, f).verdict()


class Proof:
    """One function."""

    def __init__(self, subject: Subject, f: Function) -> None:
        self.subject: Final = subject
        self.f: Final = f
        self.name: Final = symbol(subject.module, f.name)
        self.start: Final = subject.symbols[self.name]
        self.end: Final = subject.ends.get(self.name, self.start)
        self.frame: Final = Frame()
        self.registers: Final = [z3.BitVec(f"W{n}", 16) for n in range(15)]
        self.array: Final = z3.Array("memory", z3.BitVecSort(16), z3.BitVecSort(8))
        self.loops: Final = any(loop_depths(f).values())
        self.paths = 0

    def verdict(self) -> Verdict:
        """Try to prove it."""
        budget.begin()
        try:
            self._run()
        except Refuted as found:
            budget.begin()
            return Verdict(
                self.f.name, "refuted", found.what, self.loops, self.paths, self._input(found.conditions or [])
            )
        except Undecided as found:
            return Verdict(self.f.name, "undecided", str(found), self.loops, self.paths)
        return Verdict(self.f.name, "proved", "", self.loops, self.paths)

    def _input(self, conditions: Sequence[Term]) -> Witness | None:
        model = example(conditions, self._path.preferred)
        return None if model is None else witness_of(model, self.name, self.registers, self.array)

    # -- both sides --------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        if self.f.vararg:
            raise Undecided("a variable number of arguments")
        if self.f.name in self.subject.saving:
            raise Undecided("a handler that saves variables")
        start = State([*self.registers, STACK], Memory(self.array), self.start)
        begin = self._begin()
        try:
            for path in Evaluator(self.f, self.frame, self.subject.address).paths(begin):
                if feasible(path.known):
                    self.paths += 1
                    self._code(path).run(self.registers, start.copy(), self._volatile)
        except Undecided as found:
            if not self.loops:
                raise
            budget.begin()
            induction = Induction(self.subject, self.f, self.frame, start, self._begin, self._code, self._volatile)
            induction.prove(found)
            self.paths = induction.paths
        if not self.paths:
            raise Undecided("no input gets through it")

    def _code(self, path: Path) -> Code:
        self._path = path
        handler = self.subject.handlers.get(self.f.name, "")
        return Code(self.subject, self.start, self.end, self.frame, path, handler)

    def _begin(self) -> Path:
        path = Path(Memory(self.array))
        self._parameters(path)
        return path

    def _parameters(self, path: Path) -> None:
        """Where variables lie, and what parameters are (abi-elf.md §2.2)."""
        placed = self.subject.placed[self.f.name]
        sizes = {i.name: _alloca_size(i) for b in self.f.blocks for i in b.instrs if i.op == "alloca"}
        for name, size in sizes.items():
            if name not in placed:
                raise Undecided("a variable without a place in the frame")
            self.frame.objects[name] = (STACK + placed[name], size)
        for (start, size), (behind, _) in pairwise(sorted(self.frame.objects.values())):
            if start + size > behind:
                raise Undecided("variables that share a place in the frame")
        places = parameter_places(self.f)
        self.frame.lowest = STACK - max([RETURN_ADDRESS_BYTES, *(p.stack for p in places)])
        for a, place in zip(self.f.args, places, strict=True):
            if a.attrs.get("byval") is not None:
                raise Undecided("a struct parameter")
            path.values[id(a)] = (self._parameter(a, place), None)
        accesses = Accesses(self.f)
        self.frame.escaped |= accesses.escaped()
        self._volatile = {self._address(root) + at for root, at in accesses.volatile() if at is not None}

    def _address(self, root: str) -> int:
        if root[0] == "@":
            return self.subject.address(root[1:])
        return self.frame.objects[root[1:]][0]

    def _parameter(self, a: Arg, place: Place) -> Term:
        if place.register is not None:
            words = [self.registers[place.register + k] for k in range(place.words)]
        else:
            low = STACK - place.stack
            words = [joined([z3.BitVec(f"stack.{low + 2 * k + b:x}", 8) for b in (0, 1)]) for k in range(place.words)]
        whole = words[0] if len(words) == 1 else z3.Concat(*reversed(words))
        return z3.Extract(a.type.bits - 1, 0, whole) if a.type.bits < whole.size() else whole


def _alloca_size(i: Instr) -> int:
    t = i.extra["type"]
    assert isinstance(t, Type)
    count = i.args[0].value if i.args and isinstance(i.args[0], ConstInt) else 1
    return size_of(t) * count
