"""Symbolic execution of a function's code without its source, with the symbolic machine of `toolchain.proof`.

`results(words)` runs loop-free code from its first word to RETURN. All registers except W15 start as free 16-bit
values.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import z3

from emu.dspic30f.isa import codec, flow
from toolchain.proof.machine_code.machine import MachineState, SymbolicMachine
from toolchain.proof.memory import STACK, StackFrame, SymbolicMemory
from toolchain.proof.solver import feasible
from toolchain.proof.terms import BITS, SymbolicInteger, holds, narrow, vector, wide

MOST_STEPS = 4000

bounds: dict[str, tuple[Any, Any]] | None = None
"""Unknowns that replace products, by factors, with their bounds; None: products are computed in bits."""


@contextmanager
def unknown_products() -> Iterator[dict[str, tuple[Any, Any]]]:
    """Replace products by arbitrary numbers within their bounds, within the context.

    A property of all such numbers also holds for products, and the solver need not expand multipliers.
    """
    global bounds
    bounds, exact = {}, SymbolicInteger.__mul__

    def unknown(a: SymbolicInteger, b: Any) -> SymbolicInteger:
        return SymbolicInteger(times(wide(a), wide(b)))

    SymbolicInteger.__mul__ = SymbolicInteger.__rmul__ = unknown  # type: ignore[method-assign]
    try:
        yield bounds
    finally:
        bounds = None
        SymbolicInteger.__mul__ = SymbolicInteger.__rmul__ = exact  # type: ignore[method-assign]


def times(a: Any, b: Any) -> Any:
    """Return a * b as the instruction table computes it."""
    if bounds is None:
        return a * b
    a, b = sorted((z3.simplify(a), z3.simplify(b)), key=lambda term: (z3.is_bv_value(term), str(term)))
    key = f"{a} * {b}"
    if key not in bounds:
        p, word = z3.BitVec(key, BITS), (1 << 16) - 1
        words = z3.Implies(z3.And(z3.ULE(a, word), z3.ULE(b, word)), z3.ULE(p, word * word))
        signed = z3.And(a >= -(1 << 15), a < 1 << 15, z3.ULE(b, word))
        within = z3.And(p >= -(1 << 15) * word, p <= ((1 << 15) - 1) * word)
        bounds[key] = p, z3.And(words, z3.Implies(signed, within))
    return bounds[key][0]


class Free(SymbolicMachine):
    """A symbolic machine without source information: pointers address memory, words are at even addresses."""

    def load(self, ea: Any, size: int, side: str = "src", ptr: int | None = None) -> Any:
        if isinstance(ea, int):
            return super().load(ea, size, side, ptr)
        return narrow(self.state.memory.read(ea.word, size))


def start() -> MachineState:
    """Return a state in which every register, flag and byte is free."""
    w = [z3.BitVec(f"w{n}", 16) for n in range(15)]
    return MachineState([*w, STACK], SymbolicMemory(z3.Array("memory", z3.BitVecSort(16), z3.BitVecSort(8))), 0)


def results(words: list[int]) -> Iterator[MachineState]:
    """Yield the state at RETURN of every feasible path. Raises AssertionError for code with a loop."""
    page = vector(0, 16)
    machine = Free(StackFrame(), [], [], page, page)
    work, steps = [start()], 0
    while work:
        state = work.pop()
        while True:
            steps += 1
            assert steps < MOST_STEPS, "not loop-free"
            insn = _decoded(words, state.pc)
            machine.begin(state, insn)
            asked = insn.row.does(machine, insn.x)
            here, state.pc = state.pc, state.pc + 2 * insn.words
            if isinstance(asked, flow.Return):
                state.w = [vector(value, 16) if isinstance(value, int) else value for value in state.w]
                yield state
                break
            if isinstance(asked, flow.Goto):
                assert isinstance(asked.target, int)
                assert asked.target > here, "jumps back"
                state.pc = asked.target
            if not isinstance(asked, flow.Branch | flow.Skip):
                assert asked is None or isinstance(asked, flow.Goto), asked
                continue
            behind = state.pc
            there = asked.target if isinstance(asked, flow.Branch) else behind + 2 * _decoded(words, behind).words
            assert there >= behind, "jumps back"
            taken = holds(asked.cond)
            other = state.copy()
            other.path.append(taken)
            other.pc = there
            if feasible(other.path):
                work.append(other)
            state.path.append(z3.Not(taken))
            if not feasible(state.path):
                break


def _decoded(words: list[int], pc: int) -> Any:
    at = pc // 2
    insn = codec.decode(words[at], words[at + 1] if at + 1 < len(words) else 0)
    assert insn is not None, f"word {words[at]:06x}"
    return insn
