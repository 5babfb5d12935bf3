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
"""

from __future__ import annotations

from ...ir.model import Function
from ..mir import MFunction
from . import flags, form, registers, stack, traces
from .error import MachineError

__all__ = ["MachineError", "Verifier"]

RESHAPES = {"tails", "tail-calls", "branches", "returns"}  # passes that join, drop or move blocks
EXCHANGES_FLAGS = {"peephole"}  # passes that let one instruction's flags stand for another's


class Verifier:
    """Facts of one function, from pass to pass."""

    def __init__(self, f: Function) -> None:
        self.allocated = self.framed = self.selected = False
        self.source = traces.Traces.of_ir(f)

    def _take(self, m: MFunction) -> None:
        self.traces = traces.Traces.of(m)
        self.flags = flags.sources(m)
        self.undefined = registers.undefined_at_entry(m)

    def _simple(self, m: MFunction) -> None:
        form.check(m, self.allocated)
        flags.check(m)
        stack.check(m, self.framed)
        if self.framed:
            registers.check_saved(m)

    def check(self, name: str, m: MFunction) -> None:
        """Compare with the facts before pass `name`. Raises MachineError that names the pass."""
        renamed = name == "allocate"
        self.allocated |= renamed
        self.framed |= name == "frame"
        try:
            self._simple(m)
            if not self.selected:
                self.source.includes(traces.Traces.of(m).accesses_only())
                self.selected = True
                self._take(m)
            self.traces.check(m, name not in RESHAPES)
            flags.compare(self.flags, flags.sources(m), name in EXCHANGES_FLAGS)
            if self.allocated and not renamed and name != "frame":
                registers.compare(self.undefined, registers.undefined_at_entry(m))
        except MachineError as e:
            raise MachineError(f"{m.name}: after pass {name}: {e}\n{m.dump()}") from None
        self._take(m)
