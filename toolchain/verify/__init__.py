"""Machine verifier: rules that the machine form must satisfy after every pass, and facts that no pass may change.

`Verifier(f)` records the volatile accesses of legal IR. `check(name, m)` compares the machine form after a pass with
the recorded facts, raises MachineError, and records the new facts. The verifier is off by default and on in all tests
(`-fverify-machine`, or DSPIC_VERIFY_MACHINE=1).

rule                                                                                     module
the end of a block agrees with its successors; branch targets exist                      form.py
a skip covers conditional instructions, and every conditional instruction has a skip     form.py
pairs start at even registers; words and pairs do not mix; near bytes move through W0    form.py
every reader of a flag gets it from the same kind of instruction as before               flags.py
no pass leaves a register undefined where it is read; callee-saved registers are saved   registers.py
every instruction reads the value that it read before allocation                         allocation.py
pushes and pops balance on every path                                                    stack.py
volatile accesses, calls and assembly: number, order and width on every path             traces.py

Most passes change few blocks; facts of unchanged blocks are reused (`facts.py`).
"""

from __future__ import annotations

from functools import reduce
from operator import or_

from toolchain.ir.model import Function
from toolchain.mir.function import MFunction
from toolchain.verify import flags, form, registers, stack, traces
from toolchain.verify.error import MachineError
from toolchain.verify.facts import BlockFacts, collect_facts, key_of

__all__ = ["MachineError", "Verifier"]

CHANGES_BLOCKS = {"tail-merging", "tail-calls", "thread-jumps", "block-layout", "branches", "returns"}
"""Passes that merge, remove or move blocks."""
REPLACES_FLAGS = {"peephole"}
"""Passes that replace a comparison by another instruction that sets the same flags."""

Layout = tuple[object, ...]


def layout_of(m: MFunction) -> Layout:
    """Properties of a function, other than its instructions, on which the rules depend."""
    tables = tuple((name, tuple(blocks)) for name, blocks in m.tables)
    return ([b.name for b in m.blocks], tables, frozenset(m.pairs), m.uses_fp, m.dynamic_stack, m.interrupt)


class Verifier:
    """Verifier of one function; it stores the function's facts from pass to pass."""

    def __init__(self, f: Function) -> None:
        self.allocated = self.framed = self.selected = False
        self.source = traces.TraceAutomaton.of_ir(f)
        self.facts: dict[str, BlockFacts] = {}
        self.layout: Layout | None = None
        self.traces = self.source
        self.flags: set[flags.FlagUse] = set()
        self.undefined = 0

    def check(self, name: str, m: MFunction) -> None:
        """Check the function after pass `name`. Raises MachineError that names the pass."""
        renamed = name == "allocate"
        self.allocated |= renamed
        self.framed |= name == "frame"
        try:
            self._check(name, m, renamed or name == "frame")
        except MachineError as e:
            raise MachineError(f"{m.name}: after pass {name}: {e}\n{m.dump()}") from None

    def _check(self, name: str, m: MFunction, new_rules: bool) -> None:
        """Check all rules; `new_rules`: more rules apply than before the pass, or registers have been renamed."""
        keys = {b.name: key_of(b) for b in m.blocks}
        layout, before = layout_of(m), self.facts
        same_layout = layout == self.layout and not new_rules
        known = {n for n, key in keys.items() if n in before and before[n].key == key} if same_layout else set()
        if same_layout and len(known) == len(m.blocks):
            return
        form.check(m, self.allocated, known, same_layout)
        facts = collect_facts(m, keys, before)
        stack.check(m, self.framed, {n: f.stack for n, f in facts.items()})
        if self.framed:
            pushed = reduce(or_, (f.pushed for f in facts.values()))
            registers.check_saved(m, pushed, reduce(or_, (f.written for f in facts.values())))
        automaton = traces.TraceAutomaton.of(m, {n: (f.events, f.numbers) for n, f in facts.items()})
        flag_uses = {use for f in facts.values() for use in f.flag_uses}
        undefined = registers.undefined_at_entry(
            m, {n: f.reads for n, f in facts.items()}, {n: f.kill for n, f in facts.items()}
        )
        if not self.selected:
            self.source.includes(automaton.accesses_only())
            self.selected = True
        else:
            self.traces.check(automaton, name not in CHANGES_BLOCKS)
            flags.compare(self.flags, flag_uses, name in REPLACES_FLAGS)
            if self.allocated and not new_rules:
                registers.compare(self.undefined, undefined)
        self.traces, self.flags, self.undefined = automaton, flag_uses, undefined
        self.facts, self.layout = facts, layout
