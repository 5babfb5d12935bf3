"""Static facts about a decoded instruction, determined by running its row on a recording builder.

The sequencer needs them before and between instructions: which W registers form source addresses, which ones the
destination side writes (RAW stalls, isa.md §13.2), and the number of data accesses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from emu.dspic30f.isa.builder import Context, Side, Size
from emu.dspic30f.isa.flow import Flow, Return, Value
from emu.dspic30f.isa.row import Insn


@dataclass(frozen=True, slots=True)
class Facts:
    """Facts of an instruction that hold for all operand values. In masks, bit n stands for Wn."""

    source_pointers: int
    """Registers that form a source EA. If the preceding instruction wrote one, a stall occurs (isa.md §13.2)."""
    writes: int
    """Registers written directly or as a modified destination pointer. They may stall the next instruction."""
    loads: int
    reads: tuple[int, ...]
    """Data addresses that the instruction reads and that are encoded in it."""
    stores: int
    access: int
    """Cycle of the last data access, counted from the instruction's first cycle (engines.md §4.2)."""
    window_cycles: int
    """Additional cycles of a PSV window read outside REPEAT (isa.md §13.3)."""
    flow: type | None
    """Class of the Flow that the row returns; None if execution continues with the next word."""


class _Unknown:
    """An unknown value. The result of every operation on it is unknown too."""

    def _same(self, *_operands: object) -> _Unknown:
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = _same
    __and__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = _same
    __lshift__ = __rlshift__ = __rshift__ = __rrshift__ = __invert__ = __neg__ = _same
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = _same  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]


_UNKNOWN = _Unknown()


class _Notes:
    """Builder that records accesses and computes nothing."""

    def __init__(self, pc: int) -> None:
        self.context = Context()
        self.pc = pc
        self.source_pointers = 0
        self.writes = 0
        self.loads = 0
        self.reads: list[int] = []
        self.stores = 0

    def _value(self, *_arguments: object) -> Value:
        return _UNKNOWN

    select = div_trunc = rem_trunc = clz16 = ctz16 = let = w = prog = flag = reg = acc = _value

    def _nothing(self, *_arguments: object, **_flags: object) -> None:
        """Ignore an operation that affects neither stalls nor data accesses."""

    table_write = set_flags = set_reg = set_acc = trap_math = _nothing

    def set_w(self, n: int, v: Value) -> None:
        self.writes |= 1 << n

    set_wb = set_w

    def ptr(self, n: int, side: Side) -> Value:
        if side != "dst":
            self.source_pointers |= 1 << n
        return _UNKNOWN

    def set_ptr(self, n: int, v: Value, side: Side) -> None:
        if side == "dst":
            self.writes |= 1 << n

    def load(self, ea: Value, size: Size, side: Side = "src", ptr: int | None = None) -> Value:
        self.loads += 1
        if isinstance(ea, int):
            self.reads.append(ea)
        return _UNKNOWN

    def xload(self, ea: Value, ptr: int) -> Value:
        return _UNKNOWN

    yload = xload

    def store(self, ea: Value, v: Value, size: Size, ptr: int | None = None) -> None:
        self.stores += 1

    def when(self, c: Value, fn: Callable[[], None]) -> None:
        fn()


@lru_cache(maxsize=65536)
def facts_of(insn: Insn) -> Facts:
    """Return the facts of a decoded instruction, which do not depend on its address."""
    notes: Any = _Notes(0)
    flow: Flow = insn.row.does(notes, insn.x)
    kind = None if flow is None else type(flow)
    access = 1 if kind is Return else insn.row.cycles - 1
    window = 1 if insn.row.psv_class == "mov" else 2
    return Facts(
        notes.source_pointers, notes.writes, notes.loads, tuple(notes.reads), notes.stores, access, window, kind
    )


def flow_of(insn: Insn, pc: int) -> Flow:
    """Return the flow of a decoded instruction at `pc` with its static targets. Computed values are unknown."""
    notes: Any = _Notes(pc)
    return insn.row.does(notes, insn.x)
