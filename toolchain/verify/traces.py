"""Volatile traces: every sequence of volatile accesses, calls and assembly statements that the code can make after a
pass it could make before it (inclusion of two automata whose letters are the accesses, word by word).

Passes that keep the blocks also keep the accesses of each block one by one.
"""

from __future__ import annotations

from collections.abc import Mapping

from toolchain.ir.model import Function, Instr
from toolchain.mir.mir import MEMORY, MI, File, MBlock, MFunction
from toolchain.verify.error import MachineError

Letter = tuple[str, int, str]  # "r", "w" or what else happens; bytes; where, as far as the code says it
Seen = tuple[list[tuple[Letter, bool]], list[int]]
State = tuple[str, int]  # block, letters of it already read
END: Letter = ("return", 0, "")
MAX_PAIRS = 20_000  # larger products are left alone


def letters(mi: MI) -> list[Letter]:
    """What one instruction does that can be seen from outside, in order."""
    if mi.op in ("call", "tailcall", "callr", "asm"):
        return [("call" if mi.op != "asm" else "asm", 0, "")]
    if not mi.volatile:
        return []
    out: list[Letter] = []
    for directions, roles in (("r", "sSbB"), ("w", "dDbB")):
        for role, a in zip(mi.info.roles, mi.args, strict=False):
            if isinstance(a, MEMORY) and a.volatile and role in roles:
                place = a.expr if isinstance(a, File) else ""
                out += [(directions, 1 if mi.byte else 2, place)] * (2 if mi.op == "movd" else 1)
    return out


def accesses(i: Instr) -> list[Letter]:
    """The same of one instruction of legal IR: its volatile accesses, word by word."""
    stores = i.op in ("store", "storepair")
    t = i.args[0].type if stores else i.type
    if not (i.volatile or i.op in ("loadpair", "storepair")):
        return []
    return [("w" if stores else "r", 1 if t.bits <= 8 else 2, "")] * max(1, t.bits // 16)


def seen_outside(b: MBlock) -> Seen:
    """Letters of a block, each with whether it is conditional, and the numbers of its volatile accesses."""
    word: list[tuple[Letter, bool]] = []
    numbers: list[int] = []
    for mi in b.insts:
        made = letters(mi)
        word += [(letter, mi.pred) for letter in made]
        numbers += [mi.volatile for letter in made if letter[1]]
    return word, numbers


class Traces:
    """The automaton of one function."""

    def __init__(self, first: str) -> None:
        self.first = first
        self.word: dict[str, list[tuple[Letter, bool]]] = {}  # letters of a block, and whether each is conditional
        self.numbers: dict[str, list[int]] = {}
        self.succs: dict[str, list[str]] = {}
        self.ends: set[str] = set()

    @classmethod
    def of(cls, m: MFunction, seen: Mapping[str, Seen]) -> Traces:
        """Of a function in machine form, from `seen_outside` of its blocks."""
        made = cls(m.blocks[0].name)
        for b in m.blocks:
            made.word[b.name], made.numbers[b.name] = seen[b.name]
            made.succs[b.name] = list(b.succs)
            if b.insts and b.insts[-1].op in ("ret", "tailcall"):
                made.ends.add(b.name)
        return made

    @classmethod
    def of_ir(cls, f: Function) -> Traces:
        """Of legal IR, accesses only."""
        made = cls(f.blocks[0].name)
        for b in f.blocks:
            made.word[b.name] = [(letter, False) for i in b.instrs for letter in accesses(i)]
            made.succs[b.name] = list(b.succs)
            if b.instrs[-1].op == "ret":
                made.ends.add(b.name)
        return made

    def accesses_only(self) -> Traces:
        """Without calls and assembly, and without places, as IR has them."""
        made = Traces(self.first)
        made.succs, made.ends = self.succs, self.ends
        for name, word in self.word.items():
            made.word[name] = [((kind, size, ""), pred) for (kind, size, _), pred in word if size]
        return made

    def steps(self, states: frozenset[State]) -> dict[Letter, frozenset[State]]:
        """Letter -> states behind it."""
        out: dict[Letter, set[State]] = {}
        work, seen = list(states), set(states)
        while work:
            name, at = work.pop()
            word = self.word[name]
            silent: list[State] = []
            if at < len(word):
                letter, conditional = word[at]
                out.setdefault(letter, set()).add((name, at + 1))
                silent = [(name, at + 1)] if conditional else []
            else:
                if name in self.ends:
                    out.setdefault(END, set()).add((name, at))
                silent = [(s, 0) for s in self.succs[name]]
            for state in silent:
                if state not in seen:
                    seen.add(state)
                    work.append(state)
        return {letter: frozenset(after) for letter, after in out.items()}

    def check(self, after: Traces, same_blocks: bool) -> None:
        """Raise MachineError when `after` can do what this automaton cannot."""
        if same_blocks and {n: sorted(k) for n, k in after.numbers.items()} != {
            n: sorted(k) for n, k in self.numbers.items()
        }:
            raise MachineError("volatile accesses were lost or made")
        if (after.first, after.word, after.succs, after.ends) != (self.first, self.word, self.succs, self.ends):
            self.includes(after)

    def includes(self, after: Traces) -> None:
        """Raise MachineError when `after` has a trace that this automaton has not."""
        start = (frozenset([(after.first, 0)]), frozenset([(self.first, 0)]))
        work, seen = [start], {start}
        while work and len(seen) < MAX_PAIRS:
            here, there = work.pop()
            allowed = self.steps(there)
            for letter, states in after.steps(here).items():
                if letter not in allowed:
                    expected = ", ".join(sorted(map(_show, allowed))) or "nothing"
                    raise MachineError(f"{_show(letter)} where the source has {expected}")
                if letter is not END and (states, allowed[letter]) not in seen:
                    seen.add((states, allowed[letter]))
                    work.append((states, allowed[letter]))


def _show(letter: Letter) -> str:
    kind, size, place = letter
    name = {"r": "volatile read", "w": "volatile write"}.get(kind, kind)
    return f"{name} of {size} bytes{' at ' + place if place else ''}" if size else name
