"""The builder contract (isa/builder.py), which ``does`` of every row must keep with any builder."""

from __future__ import annotations

import random
from typing import Any

import pytest

from emu.dspic30f.isa.builder import Context
from emu.dspic30f.isa.row import Insn, Row
from emu.dspic30f.isa.table import ROWS
from tests.emu.isa.samples import random_insn
from tests.emu.rowmachine import REGISTERS, RowMachine

SAMPLES = 40
CONTEXTS = (
    Context(),
    Context(us=1, if_=1, rnd=1, satdw=0, sata=1, satb=1, ovate=1, ovbte=1, covte=1),
    Context(sata=1, satb=1, accsat=1, xmod=1, ymod=1, brev=1, xwm=3, ywm=10, bwm=4),
)
READ_OPERANDS, FORM_ADDRESSES, LOAD, WRITE = range(4)


class Opaque:
    """Opaque value: rows must not depend on it."""

    def _same(self, *_: object) -> Opaque:
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __neg__ = __invert__ = _same
    __and__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = _same
    __lshift__ = __rlshift__ = __rshift__ = __rrshift__ = _same
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = _same  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        raise AssertionError("a row branches on a value")

    __index__ = __int__ = __len__ = __bool__


class Watcher:
    """Builder of opaque values that checks the order of phases and records the flags."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.pc = 0x1000
        self.phase = READ_OPERANDS
        self.flags: set[str] = set()
        self.written: set[int] = set()

    def enter(self, phase: int, what: str) -> None:
        assert self.phase <= phase, f"{what} comes too late"
        self.phase = phase

    def value(self, *_: object, **__: object) -> Opaque:
        return Opaque()

    select = div_trunc = rem_trunc = clz16 = ctz16 = let = prog = flag = reg = acc = value

    def w(self, n: int) -> Opaque:
        assert n not in self.written, f"W{n} is read after it was written"
        return Opaque()

    def ptr(self, n: int, side: str) -> Opaque:
        self.enter(FORM_ADDRESSES, "ptr")
        return Opaque()

    def set_ptr(self, n: int, v: Any, side: str) -> None:
        self.enter(WRITE if side == "dst" else FORM_ADDRESSES, f"set_ptr {side}")
        self.written.add(n)

    def load(self, ea: Any, size: int, side: str = "src", ptr: int | None = None) -> Opaque:
        self.enter(LOAD, "load")
        return Opaque()

    def xload(self, ea: Any, ptr: int) -> Opaque:
        return self.load(ea, 2)

    yload = xload

    def store(self, ea: Any, v: Any, size: int, ptr: int | None = None) -> None:
        assert ptr is None or 0 <= ptr <= 15
        self.enter(WRITE, "store")

    def set_w(self, n: int, v: Any) -> None:
        assert 0 <= n <= 15
        self.enter(WRITE, "set_w")
        self.written.add(n)

    set_wb = set_w

    def set_flags(self, **flags: Any) -> None:
        self.flags |= flags.keys()

    def nothing(self, *_: object) -> None:
        """Accept the operation in any phase."""

    table_write = set_reg = set_acc = trap_math = nothing


RUNS = 120
EDGES = (0, 1, 2, 0x7FFF, 0x8000, 0x8001, 0xFFFE, 0xFFFF, 0x1000, 0x1800, 0x27FE)


class Anything(RowMachine):
    """Machine in a random state that accepts trap requests."""

    def __init__(self, insn: Insn, generator: random.Random) -> None:
        super().__init__({})
        self.generator = generator
        for address in range(0, 0x54, 2):
            self.put(address, generator.choice((generator.getrandbits(16), generator.choice(EDGES))))
        self.put(REGISTERS["TBLPAG"], generator.getrandbits(8))  # 8 bits are implemented
        self.pc = 2 * generator.randrange(0, 0xC000)
        self.shadow = {name: generator.getrandbits(16) for name in ("W0S", "W1S", "W2S", "W3S", "SRS")}

    def prog(self, address: int) -> int:
        assert 0 <= address < 1 << 24
        assert address % 2 == 0
        return self.generator.getrandbits(24)

    def set_reg(self, name: str, v: int) -> None:
        assert 0 <= v <= 0xFFFF
        super().set_reg(name, v)

    def trap_math(self, c: Any) -> None:
        assert c in (0, 1)


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.id}-{row.mnemonic}")
def test_a_row_stays_within_its_values_in_any_state(row: Row) -> None:
    """In any state of registers and modes, a row's addresses and pointers have 16 bits, accumulators 40, and flags
    one."""
    generator = random.Random(1000 + row.id)
    for _ in range(RUNS):
        insn = random_insn(row, generator)
        m = Anything(insn, generator)
        flow = insn.row.does(m, insn.x)
        for name in ("target", "end"):
            address = getattr(flow, name, 0)
            assert 0 <= address < 1 << 23
            assert address % 2 == 0
        assert 0 <= getattr(flow, "count", 0) <= 0x3FFF
        assert getattr(flow, "cond", 0) in (0, 1)


def run(insn: Insn, context: Context) -> Watcher:
    watcher = Watcher(context)
    insn.row.does(watcher, insn.x)
    return watcher


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.id}-{row.mnemonic}")
def test_a_row_is_straight_line_in_phases_and_changes_only_its_flags(row: Row) -> None:
    """isa/builder.py: a row executes its phases in order (operands, addresses, loads, writes), never branches on a
    value, and changes only the flags in its column of the table."""
    generator = random.Random(row.id)
    listed = {flag.removesuffix("=s") for flag in row.flags.split()}
    for _ in range(SAMPLES):
        insn = random_insn(row, generator)
        for context in CONTEXTS:
            seen = run(insn, context).flags
            if row.mnemonic != "RETFIE":  # the sequencer restores SR from the flow value
                assert {flag for flag in listed if flag[0] not in "OS" or flag == "OV"} <= seen
            assert seen <= listed, f"{insn} changes {seen - listed}"
            accumulator = {flag[-1] for flag in seen if flag in ("OA", "SA", "OB", "SB")}
            assert len(accumulator) <= 1, "an instruction writes one accumulator"
