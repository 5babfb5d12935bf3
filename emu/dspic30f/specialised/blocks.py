"""Functions in Python for stretches of a program: straight blocks, and targets of REPEAT.

A block starts anywhere and follows the program through untaken branches and static jumps until something only the
sequencer does comes up, or a hooked address, or LENGTH instructions. Its cycles are constants; the caller makes sure
that no event and no limit falls inside before it calls. Texts are compiled once per process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.interpreter.expressions import Expr
from emu.dspic30f.interpreter.rule_paths import PythonWays, compiled
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.isa.flow import Branch, Call, Flow, Goto, Repeat, Return, Skip
from emu.dspic30f.isa.row import Insn
from emu.dspic30f.specialised.source import CHANGED, DONE, Source, Unsupported
from emu.dspic30f.state.state import PC_MASK

LENGTH: Final = 48
"""Longest block in instructions: compiling costs about 0.1 ms each."""

Fetch = Callable[[int], Insn | None]
"""Decoded instruction at an address; None where the sequencer must look itself."""


@dataclass(frozen=True, slots=True)
class Block:
    """A function, and how far behind its beginning no event may be due (`reach`) and no limit lie (`last_start`).

    `last_start` is the latest boundary before its last instruction. Without accesses to devices nothing but such
    boundaries can notice an event, and `reach` is the same; otherwise it is the most cycles the function can take.
    """

    run: Callable[[int], int]
    reach: int
    last_start: int


NATIVE: Final = (None, Branch, Call, Goto, Repeat, Return, Skip)
"""Flows a block can do itself; the others end it."""


class _Ends(Exception):
    """The block ends before this instruction."""


class BlockWriter:
    """Writes one block from `pc`; `loop` is (DOSTART, DOEND) while a DO loop is active."""

    def __init__(
        self,
        source: Source,
        fetch: Fetch,
        hooked: Callable[[int], bool],
        loop: tuple[int, int] | None,
        length: int = LENGTH,
    ) -> None:
        self._source: Final = source
        self._length: Final = length
        self._fetch: Final = fetch
        self._hooked: Final = hooked
        self._loop: Final = loop
        self._visited: Final[set[int]] = set()
        self._cycle = 0
        """Start of the next instruction behind `c`."""
        self._longest = 0
        self._last_start = 0

    def write(self, pc: int) -> tuple[int, int] | None:
        """Write the body. Returns `Block.reach` and `Block.last_start`, None if not one instruction fits."""
        source = self._source
        first = self._fetch(pc)
        if first is None:
            return None
        pointers = facts_of(first).source_pointers
        at = source.places.at
        source.emit(f"b = c = u64[{at['cpu.cycle']}]")
        if pointers:
            source.emit(f"if u16[{at['cpu.stall']}] & {pointers}:")
            source.emit("    c += 1")
        here: int | None = pc
        while here is not None:
            if here in self._visited or len(self._visited) >= self._length or (self._visited and self._hooked(here)):
                source.leave(here, self._cycle, source.stall, DONE)
                break
            try:
                after = self._instruction(here)
            except (Unsupported, _Ends):
                source.abandon()
                if not self._visited:
                    return None
                source.leave(here, self._cycle, source.stall, DONE)
                break
            here = after
        stall = int(pointers != 0)
        last_start = self._last_start and self._last_start + stall
        return max(self._longest, self._cycle) + stall if source.watches_events else last_start, last_start

    def _instruction(self, pc: int) -> int | None:
        """One instruction; returns the address to go on with, None if the block has been left."""
        source = self._source
        source.begin(pc, self._cycle, self._cycle)
        insn = self._fetch(pc)
        if insn is None:
            raise _Ends
        facts = facts_of(insn)
        if facts.flow not in NATIVE:
            raise _Ends
        last_of_loop = self._loop is not None and pc == self._loop[1]
        if last_of_loop and facts.flow is not None:
            raise _Ends
        start = self._cycle + flow_rules.stall(source.stall if self._visited else 0, facts.source_pointers)
        source.begin(pc, self._cycle, start + facts.access)
        flow: Flow = insn.row.does(source, insn.x)
        if self._loop is not None and source.writes_modes:
            raise _Ends  # where the loop goes on, or that it ends here, is in the registers, not in this translation
        source.commit()
        source.at_entry = False
        self._visited.add(pc)
        self._last_start = self._cycle
        after = pc + 2 * insn.words & PC_MASK
        self._cycle = start + insn.row.cycles
        if flow is not None:
            return self._follow(flow, after)
        if last_of_loop:
            self._end_loop(after)
            return None
        if source.ends_here:
            source.leave(after, self._cycle, source.stall, DONE)
            return None
        return after

    def _follow(self, flow: Flow, after: int) -> int | None:
        source, at = self._source, self._source.places.at
        cycle, stall = self._cycle, source.stall
        match flow:
            case Branch(cond, target):
                source.leave(target, cycle + flow_rules.TAKEN, stall, DONE, under=str(cond))
                self._longest = max(self._longest, cycle + flow_rules.TAKEN)
                return after
            case Skip(cond):
                words = flow_rules.words_skipped(self._fetch(after))
                source.leave(after + 2 * words & PC_MASK, cycle + words, stall, DONE, under=str(cond))
                self._longest = max(self._longest, cycle + words)
                if source.ends_here:
                    source.leave(after, cycle, stall, DONE)
                    return None
                return after
            case Goto(target) | Call(target):
                if isinstance(target, int):
                    return target
                source.leave(target, cycle, stall, DONE)
            case Return(kind, target, srl, ipl3):
                source.watches_events = True  # it looks for exceptions one cycle early
                if kind != "retfie":
                    source.leave(target, cycle, stall, DONE)
                    return None
                source.settle()
                source.emit(f"u64[{at['cpu.cycle']}] = finish({target}, {srl}, {ipl3}, c + {cycle - 2}) + 1")
                source.emit(f"u16[{at['cpu.stall']}] = {stall}")
                source.emit(f"return {CHANGED}")
            case Repeat(count):
                source.settle()
                PythonWays(source.emit, {}).all(lambda m: flow_rules.repeat(m, source.places.flow, count))
                source.leave(after, cycle, stall, DONE)
        return None

    def _end_loop(self, after: int) -> None:
        """Behind the instruction at DOEND. EDT is the sequencer's."""
        source, loop = self._source, self._loop
        assert loop is not None
        source.settle()
        flow = source.places.flow
        ways = PythonWays(source.emit, {flow.edt: 0})

        def leave(again: bool) -> None:
            source.leave(
                loop[0] if again else after, self._cycle, source.stall, DONE if again else CHANGED, write=ways.line
            )

        ways.each(lambda m: flow_rules.loop_again(m, flow), leave)


def write_repeat(source: Source, insn: Insn, pc: int) -> int:
    """Write the loop of a REPEAT target: as many iterations as end by `bound`. Returns the cycles of one. RA is set
    except in the last iteration, when RCOUNT is 0.

    Raises Unsupported for targets the sequencer must run.
    """
    facts, at, flow = facts_of(insn), source.places.at, source.places.flow
    if facts.flow is not None or insn.words != 1:
        raise Unsupported("a flow change under REPEAT")
    cycles = insn.row.cycles
    source.emit(f"c = u64[{at['cpu.cycle']}]")
    source.emit(f"n = u16[{at['RCOUNT']}]")
    if facts.source_pointers:
        source.emit(f"if u16[{at['cpu.stall']}] & {facts.source_pointers}:")
        source.emit("    c += 1")
    source.emit("while True:")
    source.nested(1)
    source.emit(f"if c + {cycles} > bound:")
    source.emit(f"    return {DONE}")
    source.begin(pc, 0, facts.access)
    insn.row.does(source, insn.x)
    source.commit()
    if source.ends_here or source.modes_changed:
        raise Unsupported("a device access under REPEAT")
    source.settle()
    source.emit(f"c += {cycles}")
    source.emit(f"u64[{at['cpu.cycle']}] = c")
    source.emit(f"u16[{at['cpu.stall']}] = {source.stall}")
    counted = Expr("n", 1, 0xFFFF, atom=True)  # where it is counted down it is not 0
    ways = PythonWays(source.emit, {}, (flow.rcount, counted))

    def end(again: bool) -> None:
        if not again:
            ways.line(f"u32[{at['cpu.pc']}] = {pc + 2 & PC_MASK}")
            ways.line(f"return {DONE}")

    ways.each(lambda m: flow_rules.repeated(m, flow, 1), end)
    if flow_rules.stall(source.stall, facts.source_pointers):
        source.emit("c += 1")
    return cycles + 1


def make_function(source: Source, names: dict[str, Any]) -> Callable[[int], int]:
    """The function written in `source`, with `names` as its constants."""
    parameters = "".join(f", {name}={name}" for name in names)
    text = f"def run(bound{parameters}):\n" + "\n".join(source.lines) + "\n"
    namespace = dict(names)
    exec(compiled(text), namespace)
    function: Callable[[int], int] = namespace["run"]
    return function
