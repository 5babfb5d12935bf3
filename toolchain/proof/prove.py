"""Proof that the machine code of a function implements its IR: compares each path of the IR with the code's paths.

For each feasible path of the IR, the code is executed symbolically under the conditions of that path.  It must produce
the same events in the same order and the same result and memory.  It must preserve W8-W14, W15 and the return address
(abi-elf.md §2.1).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import z3

from toolchain.abi.arguments import ArgumentLocation
from toolchain.abi.names import symbol
from toolchain.abi.target import RETURN_ADDRESS_BYTES
from toolchain.ir.cfg import loop_depths
from toolchain.ir.model import Arg, ConstInt, Function, Instr, Type, size_of
from toolchain.proof.counterexample import Counterexample, counterexample_of
from toolchain.proof.ir.escape_analysis import Accesses
from toolchain.proof.ir.evaluator import Evaluator
from toolchain.proof.loops import Induction
from toolchain.proof.machine_code.execution import CodeExecution
from toolchain.proof.machine_code.machine import MachineState
from toolchain.proof.memory import STACK, StackFrame, SymbolicMemory, concat
from toolchain.proof.path import Path
from toolchain.proof.problem import CompiledFile
from toolchain.proof.solver import Refuted, Undecided, budget, feasible, find_model
from toolchain.proof.terms import Term
from toolchain.select.calls import parameter_locations


@dataclass(frozen=True)
class Verdict:
    """Verdict of one function: proved, refuted or undecided, with a reason; `loops`: whether its IR has a loop."""

    function: str
    kind: str
    why: str = ""
    loops: bool = False
    paths: int = 0
    counterexample: Counterexample | None = None
    """Input that refutes the function, None if the difference depends on no input."""


def verdicts(compiled: CompiledFile, only: str | None = None) -> Iterator[Verdict]:
    """Yield the verdict of every function that the file defines."""
    for f in compiled.module.functions.values():
        if f.blocks and f.linkage != "available_externally" and only in (None, f.name):
            yield Proof(compiled, f).verdict()


class Proof:
    """The proof of one function."""

    def __init__(self, compiled: CompiledFile, f: Function) -> None:
        self.compiled: Final = compiled
        self.f: Final = f
        self.name: Final = symbol(compiled.module, f.name)
        self.start: Final = compiled.symbols[self.name]
        self.end: Final = compiled.ends.get(self.name, self.start)
        self.frame: Final = StackFrame()
        self.registers: Final = [z3.BitVec(f"W{n}", 16) for n in range(15)]
        self.array: Final = z3.Array("memory", z3.BitVecSort(16), z3.BitVecSort(8))
        self.loops: Final = any(loop_depths(f).values())
        self.paths = 0

    def verdict(self) -> Verdict:
        """Return the verdict of the function."""
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

    def _input(self, conditions: Sequence[Term]) -> Counterexample | None:
        model = find_model(conditions, self._path.preferences)
        return None if model is None else counterexample_of(model, self.name, self.registers, self.array)

    # -- source and machine ------------------------------------------------------------------------------------------

    def _run(self) -> None:
        if self.f.vararg:
            raise Undecided("a variable number of arguments")
        if self.f.name in self.compiled.handlers_saving_variables:
            raise Undecided("a handler that saves variables")
        start = MachineState([*self.registers, STACK], SymbolicMemory(self.array), self.start)
        begin = self._begin()
        try:
            for path in Evaluator(self.f, self.frame, self.compiled.address).paths(begin):
                if feasible(path.conditions):
                    self.paths += 1
                    self._code(path).run(self.registers, start.copy(), self._volatile)
        except Undecided as found:
            if not self.loops:
                raise
            budget.begin()
            induction = Induction(self.compiled, self.f, self.frame, start, self._begin, self._code, self._volatile)
            induction.prove(found)
            self.paths = induction.paths
        if not self.paths:
            raise Undecided("no feasible path")

    def _code(self, path: Path) -> CodeExecution:
        self._path = path
        handler = self.compiled.handlers.get(self.f.name, "")
        return CodeExecution(self.compiled, self.start, self.end, self.frame, path, handler)

    def _begin(self) -> Path:
        path = Path(SymbolicMemory(self.array))
        self._parameters(path)
        return path

    def _parameters(self, path: Path) -> None:
        """Set the addresses of frame variables and the values of parameters (abi-elf.md §2.2)."""
        placed = self.compiled.frame_offsets[self.f.name]
        sizes = {i.name: _alloca_size(i) for b in self.f.blocks for i in b.instrs if i.op == "alloca"}
        for name, size in sizes.items():
            if name not in placed:
                raise Undecided("a variable without a frame location")
            self.frame.objects[name] = (STACK + placed[name], size)
        for (start, size), (behind, _) in pairwise(sorted(self.frame.objects.values())):
            if start + size > behind:
                raise Undecided("variables that share a frame location")
        places = parameter_locations(self.f)
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
            return self.compiled.address(root[1:])
        return self.frame.objects[root[1:]][0]

    def _parameter(self, a: Arg, place: ArgumentLocation) -> Term:
        if place.register is not None:
            words = [self.registers[place.register + k] for k in range(place.words)]
        else:
            low = STACK - place.stack
            words = [concat([z3.BitVec(f"stack.{low + 2 * k + b:x}", 8) for b in (0, 1)]) for k in range(place.words)]
        whole = words[0] if len(words) == 1 else z3.Concat(*reversed(words))
        return z3.Extract(a.type.bits - 1, 0, whole) if a.type.bits < whole.size() else whole


def _alloca_size(i: Instr) -> int:
    t = i.extra["type"]
    assert isinstance(t, Type)
    count = i.args[0].value if i.args and isinstance(i.args[0], ConstInt) else 1
    return size_of(t) * count
