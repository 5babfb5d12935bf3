"""Minimal machine that executes rows of the instruction table, with ints, a bytearray and a program dictionary.

It has no devices, traps, stalls, cycles or stack checks, so it tests ``does`` of each row without the additions of the
CPU. The engines of ``emu`` run the same vectors through ``Machine``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from emu.dspic30f.isa import codec
from emu.dspic30f.isa.builder import Context
from emu.dspic30f.isa.flow import PC_MASK, Branch, Call, Do, Goto, Repeat, Return, Skip

SR, CORCON = 0x42, 0x44
REGISTERS = {
    "SR": SR, "CORCON": CORCON, "TBLPAG": 0x32, "RCOUNT": 0x36, "MODCON": 0x46, "XMODSRT": 0x48, "XMODEND": 0x4A,
    "YMODSRT": 0x4C, "YMODEND": 0x4E, "XBREV": 0x50,
}  # fmt: skip
FLAGS = {"C": 0, "Z": 1, "OV": 2, "N": 3, "DC": 8, "SB": 12, "SA": 13, "OB": 14, "OA": 15}
READ_ONLY_SR = 0x0210  # DA, RA
Y_RAM = range(0x1800, 0x2800)


class RowMachine:
    """Builder on ints with a minimal sequencer: PC, skips, REPEAT, DO."""

    def __init__(self, program: Mapping[int, int]) -> None:
        self.data = bytearray(0x10000)
        self.program = program
        self.pc = 0
        self.shadow: dict[str, int] = {}
        self.repeating = False
        self.loops: list[list[int]] = []  # start, end, count

    def fetch(self, address: int) -> int:
        return self.program.get(address & PC_MASK, 0)

    def decode(self, pc: int) -> codec.Insn:
        insn = codec.decode(self.fetch(pc), self.fetch(pc + 2))
        assert insn is not None, f"illegal word {self.fetch(pc):06x} at {pc:06x}"
        return insn

    def step(self) -> None:
        """Run one instruction, or one iteration of a REPEAT target."""
        at = self.pc
        insn = self.decode(at)
        after = (at + 2 * insn.words) & PC_MASK
        flow = insn.row.does(self, insn.x)
        if self.repeating:
            count = self.reg("RCOUNT")
            if count:
                self.set_reg("RCOUNT", count - 1)
                return
            self.repeating = False
        self.pc = self.follow(flow, after)
        if self.loops and at == self.loops[-1][1]:
            self.end_of_loop()

    def follow(self, flow: Any, after: int) -> int:
        match flow:
            case Goto(target) | Call(target):
                return int(target)
            case Branch(cond, target):
                return target if cond else after
            case Return():
                if flow.kind == "retfie":
                    self.put(SR, flow.srl, 1)
                return int(flow.target)
            case Skip(cond):
                return after + 2 * self.decode(after).words * bool(cond) & PC_MASK
            case Repeat(count):
                self.set_reg("RCOUNT", count)
                self.repeating = count != 0
            case Do(count, end):
                self.loops.append([after, end, count])
        return after

    def end_of_loop(self) -> None:
        start, _, count = self.loops[-1]
        if count:
            self.loops[-1][2] -= 1
            self.pc = start
        else:
            self.loops.pop()

    def get(self, address: int, size: int = 2) -> int:
        return int.from_bytes(self.data[address : address + size], "little")

    def put(self, address: int, value: int, size: int = 2) -> None:
        if address == 0x1E:
            value &= ~1  # W15<0> stays 0
        self.data[address : address + size] = (value & (1 << 8 * size) - 1).to_bytes(size, "little")

    @property
    def context(self) -> Context:
        corcon, modcon = self.get(CORCON), self.reg("MODCON")

        def bit(register: int, n: int) -> int:
            return register >> n & 1

        return Context(
            us=bit(corcon, 12),
            if_=bit(corcon, 0),
            rnd=bit(corcon, 1),
            satdw=bit(corcon, 5),
            sata=bit(corcon, 7),
            satb=bit(corcon, 6),
            accsat=bit(corcon, 4),
            xmod=bit(modcon, 15),
            ymod=bit(modcon, 14),
            brev=bit(self.reg("XBREV"), 15),
            xwm=modcon & 15,
            ywm=modcon >> 4 & 15,
            bwm=modcon >> 8 & 15,
        )

    def select(self, c: Any, a: Any, b: Any) -> Any:
        return a if c else b

    def div_trunc(self, a: int, b: int) -> int:
        return 0 if b == 0 else abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)

    def rem_trunc(self, a: int, b: int) -> int:
        return 0 if b == 0 else a - b * self.div_trunc(a, b)

    def clz16(self, v: int) -> int:
        return 16 - int(v).bit_length()

    def ctz16(self, v: int) -> int:
        return (v & -v).bit_length() - 1 if v else 16

    def let(self, v: Any) -> Any:
        assert -(1 << 62) < v < 1 << 62, "values fit native registers"
        return v

    def w(self, n: int) -> int:
        return self.get(2 * n)

    def set_w(self, n: int, v: int) -> None:
        self.put(2 * n, v)

    def set_wb(self, n: int, v: int) -> None:
        self.data[2 * n] = v & (0xFE if n == 15 else 0xFF)

    def ptr(self, n: int, side: str) -> int:
        return self.w(n)

    def set_ptr(self, n: int, v: int, side: str) -> None:
        assert 0 <= v <= 0xFFFF, "pointer updates are masked by the row"
        self.put(2 * n, v)

    def load(self, ea: int, size: int, side: str = "src", ptr: int | None = None) -> int:
        assert 0 <= ea <= 0xFFFF, "addresses are masked by the row"
        return self.get(ea, size)

    def store(self, ea: int, v: int, size: int, ptr: int | None = None) -> None:
        assert 0 <= ea <= 0xFFFF, "addresses are masked by the row"
        kept = self.get(SR) & READ_ONLY_SR
        self.put(ea, v, size)
        self.put(SR, self.get(SR) & ~READ_ONLY_SR | kept)

    def xload(self, ea: int, ptr: int) -> int:
        return 0 if ea in Y_RAM else self.get(ea)

    def yload(self, ea: int, ptr: int) -> int:
        return self.get(ea) if ea in Y_RAM else 0

    def prog(self, address: int) -> int:
        return self.program.get(address, 0)

    def table_write(self, address: int, byte_mask: int, v: int) -> None:
        self.shadow[f"latch {address:06x}/{byte_mask}"] = v

    def flag(self, name: str) -> int:
        return self.get(SR) >> FLAGS[name] & 1

    def set_flags(self, **flags: int) -> None:
        sr = self.get(SR)
        for name, value in flags.items():
            assert value in (0, 1), f"{name} is a bit"
            sr = sr & ~(1 << FLAGS[name]) | int(value) << FLAGS[name]
        for pair, both in ((0xC000, 0x0800), (0x3000, 0x0400)):
            sr = sr | both if sr & pair else sr & ~both
        self.put(SR, sr)

    def reg(self, name: str) -> int:
        return self.get(REGISTERS[name]) if name in REGISTERS else self.shadow[name]

    def set_reg(self, name: str, v: int) -> None:
        if name in REGISTERS:
            self.put(REGISTERS[name], v)
        else:
            self.shadow[name] = v

    def acc(self, i: int) -> int:
        raw = self.get(0x22 + 6 * i) | self.get(0x24 + 6 * i) << 16 | (self.get(0x26 + 6 * i) & 0xFF) << 32
        return raw - ((raw >> 39) << 40)

    def set_acc(self, i: int, v: int) -> None:
        assert -(1 << 39) <= v < 1 << 39, "accumulators are written as signed 40-bit values"
        for part in range(3):
            self.put(0x22 + 6 * i + 2 * part, v >> 16 * part)

    def when(self, c: Any, fn: Callable[[], None]) -> None:
        if c:
            fn()

    def trap_math(self, c: Any) -> None:
        assert not c, "no vector traps"
