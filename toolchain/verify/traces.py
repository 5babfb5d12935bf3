"""Rule of volatile traces: a pass adds no sequence of volatile accesses, calls and assembly statements.

The traces of a function are the language of an automaton whose letters are these events, word by word. The verifier
checks that the language after a pass is included in the one before. Passes that keep the blocks also keep the accesses
of every block.
"""

from __future__ import annotations

from collections.abc import Mapping

from toolchain.ir.model import Function, Instr
from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import MEMORY, FileRegister
from toolchain.verify.error import MachineError

TraceEvent = tuple[str, int, str]  # ("r", "w", "call", "asm" or "return"; bytes; address, "" if unknown)
BlockEvents = tuple[list[tuple[TraceEvent, bool]], list[int]]
"""Events of a block, each with whether it is conditional; numbers of its volatile accesses."""
TraceState = tuple[str, int]  # (block, number of its events already read)
END: TraceEvent = ("return", 0, "")
MAX_PAIRS = 20_000  # maximum number of state pairs checked in a product automaton


def events_of(mi: MI) -> list[TraceEvent]:
    """Events of one instruction, in order."""
    if mi.op in ("call", "tailcall", "callr", "asm"):
        return [("call" if mi.op != "asm" else "asm", 0, "")]
    if not mi.volatile:
        return []
    out: list[TraceEvent] = []
    for direction, roles in (("r", "sSbB"), ("w", "dDbB")):
        for role, a in zip(mi.info.roles, mi.args, strict=False):
            if isinstance(a, MEMORY) and a.volatile and role in roles:
                address = a.expr if isinstance(a, FileRegister) else ""
                out += [(direction, 1 if mi.byte else 2, address)] * (2 if mi.op == "movd" else 1)
    return out


def accesses(i: Instr) -> list[TraceEvent]:
    """Volatile accesses of one instruction of legal IR, word by word."""
    stores = i.op in ("store", "storepair")
    t = i.args[0].type if stores else i.type
    if not (i.volatile or i.op in ("loadpair", "storepair")):
        return []
    return [("w" if stores else "r", 1 if t.bits <= 8 else 2, "")] * max(1, t.bits // 16)


def observable_events(b: MBlock) -> BlockEvents:
    """Events of a block and the numbers of its volatile accesses."""
    events: list[tuple[TraceEvent, bool]] = []
    numbers: list[int] = []
    for mi in b.insts:
        made = events_of(mi)
        events += [(event, mi.pred) for event in made]
        numbers += [mi.volatile for event in made if event[1]]
    return events, numbers


class TraceAutomaton:
    """Automaton that accepts the traces of one function."""

    def __init__(self, first: str) -> None:
        self.first = first
        self.events: dict[str, list[tuple[TraceEvent, bool]]] = {}  # by block: (event, is conditional)
        self.numbers: dict[str, list[int]] = {}
        self.succs: dict[str, list[str]] = {}
        self.ends: set[str] = set()

    @classmethod
    def of(cls, m: MFunction, events: Mapping[str, BlockEvents]) -> TraceAutomaton:
        """Automaton of a function in machine form, from `observable_events` of its blocks."""
        made = cls(m.blocks[0].name)
        for b in m.blocks:
            made.events[b.name], made.numbers[b.name] = events[b.name]
            made.succs[b.name] = list(b.succs)
            if b.insts and b.insts[-1].op in ("ret", "tailcall"):
                made.ends.add(b.name)
        return made

    @classmethod
    def of_ir(cls, f: Function) -> TraceAutomaton:
        """Automaton of legal IR; its events are accesses only."""
        made = cls(f.blocks[0].name)
        for b in f.blocks:
            made.events[b.name] = [(event, False) for i in b.instrs for event in accesses(i)]
            made.succs[b.name] = list(b.succs)
            if b.instrs[-1].op == "ret":
                made.ends.add(b.name)
        return made

    def accesses_only(self) -> TraceAutomaton:
        """The automaton without calls, assembly and addresses, comparable with `of_ir`."""
        made = TraceAutomaton(self.first)
        made.succs, made.ends = self.succs, self.ends
        for name, events in self.events.items():
            made.events[name] = [((kind, size, ""), pred) for (kind, size, _), pred in events if size]
        return made

    def steps(self, states: frozenset[TraceState]) -> dict[TraceEvent, frozenset[TraceState]]:
        """States after each possible next event."""
        out: dict[TraceEvent, set[TraceState]] = {}
        work, seen = list(states), set(states)
        while work:
            name, at = work.pop()
            events = self.events[name]
            silent: list[TraceState] = []
            if at < len(events):
                event, conditional = events[at]
                out.setdefault(event, set()).add((name, at + 1))
                silent = [(name, at + 1)] if conditional else []
            else:
                if name in self.ends:
                    out.setdefault(END, set()).add((name, at))
                silent = [(s, 0) for s in self.succs[name]]
            for state in silent:
                if state not in seen:
                    seen.add(state)
                    work.append(state)
        return {event: frozenset(after) for event, after in out.items()}

    def check(self, after: TraceAutomaton, same_blocks: bool) -> None:
        """Raise MachineError if `after` has additional traces.

        With `same_blocks`, also raise it if any block lost or gained volatile accesses.
        """
        if same_blocks and {n: sorted(k) for n, k in after.numbers.items()} != {
            n: sorted(k) for n, k in self.numbers.items()
        }:
            raise MachineError("volatile accesses were lost or added")
        if (after.first, after.events, after.succs, after.ends) != (self.first, self.events, self.succs, self.ends):
            self.includes(after)

    def includes(self, after: TraceAutomaton) -> None:
        """Raise MachineError if `after` has a trace that this automaton does not have."""
        start = (frozenset([(after.first, 0)]), frozenset([(self.first, 0)]))
        work, seen = [start], {start}
        while work and len(seen) < MAX_PAIRS:
            here, there = work.pop()
            allowed = self.steps(there)
            for event, states in after.steps(here).items():
                if event not in allowed:
                    expected = ", ".join(sorted(map(_show, allowed))) or "nothing"
                    raise MachineError(f"{_show(event)} where the source has {expected}")
                if event is not END and (states, allowed[event]) not in seen:
                    seen.add((states, allowed[event]))
                    work.append((states, allowed[event]))


def _show(event: TraceEvent) -> str:
    kind, size, address = event
    name = {"r": "volatile read", "w": "volatile write"}.get(kind, kind)
    return f"{name} of {size} bytes{' at ' + address if address else ''}" if size else name
