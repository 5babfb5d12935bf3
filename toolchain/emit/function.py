"""Assembly text of one function in machine form (pic30-as syntax, abi-elf.md §4)."""

from __future__ import annotations

import re
from collections.abc import Callable

from emu.dspic30f.isa.rows.multiply import DIVIDE_COUNT
from toolchain.abi.names import block_label
from toolchain.abi.target import SP
from toolchain.debuginfo.call_frames import CallFrames
from toolchain.debuginfo.variables import LocationLists, verified_locations
from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import FileRegister, Imm, Mem, Operand

MEM_TEXT = {"ind": "[w{}]", "++": "[w{}++]", "--": "[w{}--]", "+": "[++w{}]", "-": "[--w{}]"}
RENAMED = {
    "sl1": "sl",
    "lsr1": "lsr",
    "asr1": "asr",
    "movd": "mov.d",
    "btst": "btst",
    "btstv": "btst.z",
    "btstc": "btst.c",
}
FILE_OPS = {n + "f": n for n in ("inc", "dec", "inc2", "dec2", "neg", "com", "clr", "setm", "sl", "lsr", "asr", "bset",
                                 "bclr", "btg", "btst", "btsc", "btss", "cp0", "add", "sub", "addc", "subb", "and",
                                 "ior", "xor",
                                 "cp")}  # fmt: skip
TIED_OPS = {n + "l": n for n in ("add", "sub", "addc", "subb", "and", "ior", "xor")}
BIT_OPS = {"bset", "bclr", "btg", "btst", "btsc", "btss"}
WREG_OPS = {n + "w": n for n in ("and", "ior", "xor")}
CONDITION_TEXT = {"c": "geu", "nc": "ltu"}
ASM_OPERAND = re.compile("\x00(\\d+):(\\w?)\x00|\x00uid\x00")
ENTRY_CYCLES = 4  # cycles from the comparison with DISICNT to the first instruction of the atomic section
SHIFT_FIRST = {"shl": "sl", "lshr": "lsr", "ashr": "asr"}


def operand_text(a: Operand) -> str:
    """One operand in assembler syntax."""
    match a:
        case int():
            return f"w{a}"
        case Imm():
            return f"#{a.value}"
        case Mem(mode="off"):
            return f"[w{a.base}{a.off:+d}]"
        case Mem(mode="idx"):
            return f"[w{a.base}+w{a.off}]"
        case Mem():
            return MEM_TEXT[a.mode].format(a.base)
        case FileRegister():
            return a.expr
        case _:
            return str(a)


class FunctionEmitter:
    """Writer of the assembly text of one function."""

    def __init__(
        self, m: MFunction, prefix: str, large_code: bool, position: Callable[[str | None], tuple[str, int] | None]
    ) -> None:
        self.m = m
        self.position = position  # returns source file and line of a !dbg reference
        self.prefix = prefix  # prefix that makes local labels unique in the file
        self.large_code = large_code
        self.serial = 0
        self.lines: list[str] = []
        self.numbers = {b.name: k for k, b in enumerate(m.blocks)}
        self.targets = {a for b in m.blocks for mi in b.insts for a in mi.args if mi.op in ("bra", "jump")}
        self.targets |= {t for _, table in m.tables for t in table}

    def label(self, block: str) -> str:
        """Local label of a block."""
        return f".L{self.prefix}_{self.numbers[block]}"

    def fresh(self) -> str:
        """Return a new, unique local label for use inside a block."""
        self.serial += 1
        return f".L{self.prefix}_i{self.serial}"

    def text(
        self, location: Callable[[str | None], str], ranges: LocationLists, frames: CallFrames | None
    ) -> list[str]:
        """All lines of the function; `location` returns the line-table label of a !dbg reference, or ""."""
        self.frames = frames
        self.variables = verified_locations(self.m) if self.m.bindings else {}
        for block in self.m.blocks:
            self._block(block, location, ranges)
        return self.lines

    def _block(self, block: MBlock, location: Callable[[str | None], str], ranges: LocationLists) -> None:
        if block.name in self.targets:
            self.lines.append(f"{self.label(block.name)}:")
        if block.address_taken:
            self.lines.append(f"{block_label(self.m.name, block.name)}:")
        label = ""  # label after the instructions that a skip covers
        for mi in block.insts:
            frame = self.frames.at(mi) if self.frames is not None else ""
            marks = (ranges.at(self.variables.get(id(mi), ())), location(mi.line), frame)
            self.lines += [mark for mark in marks if mark]
            if label and not mi.pred:
                self.lines.append(f"{label}:")
                label = ""
            if mi.op == "skip":
                label = self.fresh()
                self._out(f"bra {CONDITION_TEXT.get(mi.cc, mi.cc)},{label}")
            else:
                self._instruction(mi)
        if label:
            self.lines.append(f"{label}:")

    def _out(self, text: str) -> None:
        self.lines.append("\t" + text)

    def _instruction(self, mi: MI) -> None:
        handler = SPECIAL.get(mi.op)
        if handler is not None:
            handler(self, mi)
            return
        op, args = mi.op, [operand_text(a) for a in mi.args]
        if op in WREG_OPS:
            self._out(f"{WREG_OPS[op]}{'.b' if mi.byte else ''} {args[0]},WREG")
            return
        if op in FILE_OPS:
            self._file(mi, FILE_OPS[op], args)
            return
        if op == "mov" and mi.byte:
            args = self._byte_move(mi, args)
            op = "mov.b"
        else:
            op = TIED_OPS.get(op) or RENAMED.get(op, op)
            op += ".b" if mi.byte else ""
        self._out(f"{op} {','.join(args)}")

    def _byte_move(self, mi: MI, args: list[str]) -> list[str]:
        if isinstance(mi.args[0], FileRegister):
            return [args[0], "WREG"]
        if isinstance(mi.args[1], FileRegister):
            return ["WREG", args[1]]
        return args

    def _file(self, mi: MI, op: str, args: list[str]) -> None:
        self._out(f"{op}{'.b' if mi.byte else ''} {args[0]}" + (f",{args[1]}" if op in BIT_OPS else ""))

    # -- special instructions -----------------------------------------------------------------------------------------

    def _bra(self, mi: MI) -> None:
        self._out(f"bra {CONDITION_TEXT.get(mi.cc, mi.cc)},{self.label(str(mi.args[0]))}")

    def _jump(self, mi: MI) -> None:
        self._out(f"bra {self.label(str(mi.args[0]))}")

    def _jumpr(self, mi: MI) -> None:
        self._out(f"goto {operand_text(mi.args[0])}")

    def _brtable(self, mi: MI) -> None:
        self._out(f"bra {operand_text(mi.args[0])}")
        for target in self.m.tables[int(str(mi.args[1]))][1]:
            self._out(f"bra {self.label(target)}")

    def _call(self, mi: MI) -> None:
        self._out(f"{'call' if self.large_code else 'rcall'} {mi.args[0]}")

    def _callr(self, mi: MI) -> None:
        self._out(f"call {operand_text(mi.args[0])}")

    def _tailcall(self, mi: MI) -> None:
        self._out(f"{'goto' if self.large_code else 'bra'} {mi.args[0]}")

    def _ret(self, mi: MI) -> None:
        self._out("retfie" if self.m.interrupt else mi.text or "return")

    def _divide(self, mi: MI) -> None:
        self._out(f"repeat #{DIVIDE_COUNT}")
        self._out(f"{mi.op} {operand_text(mi.args[0])},{operand_text(mi.args[1])}")

    def _repeat(self, mi: MI) -> None:
        suffix = ".b" if mi.byte else ""
        self._out(f"repeat {operand_text(mi.args[0])}")
        if mi.op == "repmov":
            count = mi.args[0]
            if self.frames is not None and mi.args[2] == SP and isinstance(count, Imm) and count.value:
                self.lines.append(self.frames.repeated(int(count.value)))
            self._out(f"mov{suffix} [w{mi.args[1]}++],[w{mi.args[2]}++]")
        elif mi.op == "repclr":
            self._out(f"clr{suffix} [w{mi.args[1]}++]")
        else:
            self._out(f"mov{suffix} w{mi.args[2]},[w{mi.args[1]}++]")

    def _shiftloop(self, mi: MI) -> None:
        """Emit a loop: decrement the count, exit if negative, shift by one through the carry (abi-elf.md §8.1)."""
        kind, count, *words = mi.args
        top, end = self.fresh(), self.fresh()
        self.lines.append(f"{top}:")
        self._out(f"dec w{count},w{count}")
        self._out(f"bra n,{end}")
        order = words if kind == "shl" else list(reversed(words))
        for k, w in enumerate(order):
            op = SHIFT_FIRST[str(kind)] if k == 0 else "rlc" if kind == "shl" else "rrc"
            self._out(f"{op} w{w},w{w}")
        self._out(f"bra {top}")
        self.lines.append(f"{end}:")

    def _asm(self, mi: MI) -> None:
        self.serial += 1
        uid = str(self.serial)

        def replace(m: re.Match[str]) -> str:
            if m[1] is None:
                return self.prefix + uid
            a = mi.args[int(m[1])]
            modifier = m[2]
            if isinstance(a, int) and modifier == "d":
                return f"w{a + 1}"
            if isinstance(a, Imm):  # no `#`: XC16 sources contain it in the template, as in "disi #%0"
                return str(-int(a.value)) if modifier == "n" else str(a.value)
            return operand_text(a)

        position = self.position(mi.line)
        if position is not None:  # a line marker, so that the assembler reports errors at the source line
            self.lines.append(f'# {position[1]} "{position[0]}"')
        for line in ASM_OPERAND.sub(replace, mi.text).split("\n"):
            if line.strip():
                self._out(line.strip())
                if self.frames is not None and (mark := self.frames.inside(line)):
                    self.lines.append(mark)
        if position is not None:
            self.lines.append(f'# 0 "{position[0]}"')  # line 0: end of the source lines

    def _begin_atomic(self, mi: MI) -> None:
        """Emit DISI for an atomic section (`atomic_sections`), skipped if DISICNT is already larger."""
        cycles, end = mi.number(0), self.fresh()
        self._out(f"mov #{cycles + ENTRY_CYCLES},w0")
        self._out("cp _DISICNT")
        self._out(f"bra geu,{end}")
        self._out(f"disi #{cycles}")
        self.lines.append(f"{end}:")

    def _end_atomic(self, mi: MI) -> None:
        """Emit no code: the DISI ends after its cycles."""

    def _clear_pair(self, mi: MI) -> None:
        """Emit a multiplication by 0 that clears a register pair without changing flags (isa.md §6.5)."""
        self._out(f"mul.uu w{mi.args[0]},#0,w{mi.args[0]}")

    def _borrow(self, mi: MI) -> None:
        """Emit the subtraction that sets a register to -1 after a borrow, else to 0."""
        r = operand_text(mi.args[0])
        self._out(f"subb {r},{r},{r}")

    def _low_move(self, mi: MI) -> None:
        self._out(f"mov.b {operand_text(mi.args[0])},{operand_text(mi.args[1])}")

    def _low_logic(self, mi: MI) -> None:
        r, source = map(operand_text, mi.args)
        self._out(f"{mi.op.removesuffix('low')}.b {r},{source},{r}")

    def _plain_text(self, mi: MI) -> None:
        self._out(str(mi.args[0]))


SPECIAL: dict[str, Callable[[FunctionEmitter, MI], None]] = {
    "bra": FunctionEmitter._bra,
    "jump": FunctionEmitter._jump,
    "jumpr": FunctionEmitter._jumpr,
    "brtable": FunctionEmitter._brtable,
    "call": FunctionEmitter._call,
    "callr": FunctionEmitter._callr,
    "tailcall": FunctionEmitter._tailcall,
    "ret": FunctionEmitter._ret,
    "div.s": FunctionEmitter._divide,
    "div.u": FunctionEmitter._divide,
    "div.sd": FunctionEmitter._divide,
    "div.ud": FunctionEmitter._divide,
    "repmov": FunctionEmitter._repeat,
    "repclr": FunctionEmitter._repeat,
    "repfill": FunctionEmitter._repeat,
    "shiftloop": FunctionEmitter._shiftloop,
    "asm": FunctionEmitter._asm,
    "borrow": FunctionEmitter._borrow,
    "clrd": FunctionEmitter._clear_pair,
    "begin_atomic": FunctionEmitter._begin_atomic,
    "end_atomic": FunctionEmitter._end_atomic,
    "text": FunctionEmitter._plain_text,
    "movlow": FunctionEmitter._low_move,
    "iorlow": FunctionEmitter._low_logic,
    "xorlow": FunctionEmitter._low_logic,
}
