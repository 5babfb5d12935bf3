"""The machine verifier: what every function must satisfy after every pass, and what no pass may change.

`Verifier(f)` takes down the volatile accesses of legal IR; `check(name, m)` compares after a pass, raises MachineError,
and takes the new facts down. Off by default, on in all tests (`-fverify-machine`, or DSPIC_VERIFY_MACHINE=1).

rule                                                                                     file
blocks end where they say; branches have targets                                         form.py
a skip covers what is conditional, and nothing conditional stands without one            form.py
pairs are even, words are words, near bytes move through W0                              form.py
flags are read where the same kind of instruction left them                              flags.py
no register is read that the pass left undefined; saved registers are saved              registers.py
the value an instruction wants is in the register it reads (allocation)                  allocation.py
pushes and pops balance on every path                                                    stack.py
volatile accesses, calls and assembly: number, order and width on every path             traces.py

A pass leaves most blocks alone: what the rules need of a block is found again only when it has changed (`facts.py`).
"""

from __future__ import annotations

from functools import reduce
from operator import or_

from toolchain.ir.model import Function
from toolchain.mir.mir import MFunction
from toolchain.verify import flags, form, registers, stack, traces
from toolchain.verify.error import MachineError
from toolchain.verify.facts import Facts, key_of, taken_down

__all__ = ["MachineError", "Verifier"]

RESHAPES = {"tails", "tail-calls", "branches", "returns"}  # passes that join, drop or move blocks
EXCHANGES_FLAGS = {"peephole"}  # passes that let one instruction's flags stand for another's


Layout = tuple[object, ...]


def layout_of(m: MFunction) -> Layout:
    """What the rules look at beside the blocks."""
    tables = tuple((name, tuple(blocks)) for name, blocks in m.tables)
    return ([b.name for b in m.blocks], tables, frozenset(m.pairs), m.uses_fp, m.dynamic_stack, m.interrupt)


class Verifier:
    """Facts of one function, from pass to pass."""

    def __init__(self, f: Function) -> None:
        self.allocated = self.framed = self.selected = False
        self.source = traces.Traces.of_ir(f)
        self.facts: dict[str, Facts] = {}
        self.layout: Layout | None = None
        self.traces = self.source
        self.flags: set[flags.Source] = set()
        self.undefined = 0

    def check(self, name: str, m: MFunction) -> None:
        """Compare with the facts before pass `name`. Raises MachineError that names the pass."""
        renamed = name == "allocate"
        self.allocated |= renamed
        self.framed |= name == "frame"
        try:
            self._check(name, m, renamed or name == "frame")
        except MachineError as e:
            raise MachineError(f"{m.name}: after pass {name}: {e}\n{m.dump()}") from None

    def _check(self, name: str, m: MFunction, new_rules: bool) -> None:
        """`new_rules`: more is asked of the machine form than before the pass, or it has other registers."""
        keys = {b.name: key_of(b) for b in m.blocks}
        layout, before = layout_of(m), self.facts
        same_layout = layout == self.layout and not new_rules
        known = {n for n, key in keys.items() if n in before and before[n].key == key} if same_layout else set()
        if same_layout and len(known) == len(m.blocks):
            return
        form.check(m, self.allocated, known, same_layout)
        facts = taken_down(m, keys, before)
        stack.check(m, self.framed, {n: f.stack for n, f in facts.items()})
        if self.framed:
            pushed = reduce(or_, (f.pushed for f in facts.values()))
            registers.check_saved(m, pushed, reduce(or_, (f.written for f in facts.values())))
        made = traces.Traces.of(m, {n: (f.word, f.numbers) for n, f in facts.items()})
        sources = {s for f in facts.values() for s in f.sources}
        undefined = registers.undefined_at_entry(
            m, {n: f.reads for n, f in facts.items()}, {n: f.kill for n, f in facts.items()}
        )
        if not self.selected:
            self.source.includes(made.accesses_only())
            self.selected = True
        else:
            self.traces.check(made, name not in RESHAPES)
            flags.compare(self.flags, sources, name in EXCHANGES_FLAGS)
            if self.allocated and not new_rules:
                registers.compare(self.undefined, undefined)
        self.traces, self.flags, self.undefined, self.facts, self.layout = made, sources, undefined, facts, layout
