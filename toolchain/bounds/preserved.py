"""Registers W8-W14 that functions preserve, by a data-flow analysis of their saves and restores on the stack.

The calling convention requires all functions to preserve them (abi-elf.md §2.1).  Assembly routines that call each
other may use them as common variables instead: their callers must not assume the values from before the call.
"""

from __future__ import annotations

from enum import IntEnum
from functools import lru_cache
from typing import Final

from emu.dspic30f.isa.facts import facts_of, flow_of
from emu.dspic30f.isa.flow import Call
from emu.dspic30f.isa.row import Insn
from toolchain.bounds.abstract.state import AbstractState, StackAreas
from toolchain.bounds.graph import FunctionGraph, GraphBuilder, Instruction
from toolchain.bounds.transfer import ImageModel, TransferFunctions, is_constant

FIRST, FRAME, STACK = 8, 14, 15
PUSH_MODE, POP_MODE = 3, 4
"""Encodings of the addressing modes [Wn++] and [--Wn] (isa.md §3.1)."""


class RegisterContent(IntEnum):
    """Content of a register within a function, relative to its value at entry."""

    ENTRY = 0
    """The value at entry, which is not saved."""
    SAVED = 1
    """The value at entry, which is saved on the stack."""
    CHANGED = 2
    """Another value; the value at entry is saved."""
    LOST = 3
    """Another value; the value at entry is not saved on some path."""


Contents = tuple[RegisterContent, ...]
_WRITTEN: Final = {RegisterContent.ENTRY: RegisterContent.LOST, RegisterContent.SAVED: RegisterContent.CHANGED}
_RESTORED: Final = {RegisterContent.ENTRY: RegisterContent.LOST, RegisterContent.CHANGED: RegisterContent.SAVED}


def _join(a: RegisterContent, b: RegisterContent) -> RegisterContent:
    if a == b:
        return a
    pair = {a, b}
    if pair == {RegisterContent.ENTRY, RegisterContent.SAVED}:
        return RegisterContent.ENTRY
    return RegisterContent.CHANGED if pair == {RegisterContent.SAVED, RegisterContent.CHANGED} else RegisterContent.LOST


class PreservedRegisters:
    """Registers W8-W14 that calls of each function of an image change."""

    def __init__(self, graph: GraphBuilder) -> None:
        self.graph: Final = graph
        self._codes: Final[dict[int, FunctionGraph]] = {}
        self._changed: Final[dict[int, frozenset[int]]] = {}

    def changed_by(self, entry: int) -> frozenset[int]:
        """Return the numbers of the registers W8-W14 that may differ after a call of the function."""
        if entry not in self._changed:
            functions = self._callees(entry)
            while self._refine(functions):
                pass
        return self._changed[entry]

    def _callees(self, entry: int) -> list[int]:
        """Return the functions reachable from `entry` that have no result yet, and set their results to empty."""
        found, work = [], [entry]
        while work:
            function = work.pop()
            if function in self._changed:
                continue
            self._changed[function] = frozenset()
            found.append(function)
            code = self._codes[function] = self.graph.code(function)
            work += code.tail_calls.values()
            work += [t for b in code.blocks.values() if (t := _callee(b.steps[-1])) is not None]
        return found

    def _refine(self, functions: list[int]) -> bool:
        """Analyse each function once more; return whether a result has grown."""
        before = [self._changed[function] for function in functions]
        for function in reversed(functions):
            self._changed[function] |= self._function(self._codes[function])
        return before != [self._changed[function] for function in functions]

    def _function(self, code: FunctionGraph) -> frozenset[int]:
        start: Contents = (RegisterContent.ENTRY,) * (STACK - FIRST)
        states = {code.entry: start} if code.entry in code.blocks else {}
        work = list(states)
        changed: set[int] = set()
        while work:
            head = work.pop()
            block, now = code.blocks[head], states[head]
            for step in block.steps:
                now = self._step(code, step, now)
            if not block.following:
                changed |= {FIRST + k for k, content in enumerate(now) if content >= RegisterContent.CHANGED}
            for after in block.following:
                joined = tuple(map(_join, states[after], now)) if after in states else now
                if states.get(after) != joined:
                    states[after] = joined
                    work.append(after)
        return frozenset(changed)

    def _step(self, code: FunctionGraph, step: Instruction, now: Contents) -> Contents:
        saved, restored, written = stack_effect(step.insn)
        callee = code.tail_calls.get(step.pc) or _callee(step)
        if callee is not None:
            written |= self._changed.get(callee, frozenset())
        if not saved and not restored and not written:
            return now
        new = list(now)
        for k, content in enumerate(now):
            number = FIRST + k
            if number in saved and content == RegisterContent.ENTRY:
                new[k] = content = RegisterContent.SAVED
            if number in restored:
                new[k] = _RESTORED.get(content, content)
            elif number in written:
                new[k] = _WRITTEN.get(content, content)
        return tuple(new)


def _callee(step: Instruction) -> int | None:
    """Return the target of a call with a known target."""
    match flow_of(step.insn, step.pc) if step.flow is Call else None:
        case Call(target) if isinstance(target, int) and target:
            return target
    return None


@lru_cache(maxsize=65536)
def stack_effect(insn: Insn) -> tuple[frozenset[int], frozenset[int], frozenset[int]]:
    """Return the registers that an instruction pushes, pops, and changes otherwise."""
    name, x = insn.row.mnemonic, insn.x
    if name == "LNK":
        return frozenset((FRAME,)), frozenset(), frozenset((FRAME,))
    if name == "ULNK":
        return frozenset(), frozenset((FRAME,)), frozenset()
    saved: frozenset[int] = frozenset()
    restored: frozenset[int] = frozenset()
    if name in ("MOV", "MOV.D") and not getattr(x, "B", 0):
        size = 2 if name == "MOV.D" else 1
        fields = insn.row.fields
        source, target = (next((getattr(x, m) for m in modes if m in fields), 0) for modes in ("pg", "qh"))
        if "s" in fields and "d" in fields:
            if (source, target, x.d) == (0, PUSH_MODE, STACK):
                saved = frozenset(range(x.s, x.s + size))
            if (source, target, x.s) == (POP_MODE, 0, STACK):
                restored = frozenset(range(x.d, x.d + size))
    return saved, restored, _written(insn) - restored


def _written(insn: Insn) -> frozenset[int]:
    """Return the registers that an instruction writes, modified pointers included."""
    state = AbstractState()
    state.w[:] = [0x1000 + 0x20 * number for number in range(16)]
    transfer = TransferFunctions(ImageModel(StackAreas([]), {}, {}))
    before, direct = list(state.w), facts_of(insn).writes
    transfer.begin(0, state)
    insn.row.does(transfer, insn.x)
    return frozenset(
        number
        for number, (old, new) in enumerate(zip(before, state.w, strict=True))
        if direct >> number & 1 or not is_constant(new) or new != old
    )
