"""Selection of XC16's builtins (abi-elf.md §2.9), which in the IR are calls of external functions."""

from __future__ import annotations

from emu.dspic30f.isa.debugger_words import FAILED_CHECK, HALT
from toolchain.abi.names import symbol
from toolchain.ir.model import ConstInt, GlobalRef, Instr, UnsupportedError
from toolchain.mir.operands import Imm, Mem
from toolchain.mir.operations import opaque
from toolchain.select.context import Handler, SelectionContext


def _constant(i: Instr, k: int, limit: int) -> int:
    """Argument `k`, a constant. Raise UnsupportedError unless it is a constant from 0 to `limit`."""
    v = i.args[k]
    if not isinstance(v, ConstInt) or v.value > limit:
        raise UnsupportedError(f"{i.extra['name']}: argument {k + 1} must be a constant from 0 to {limit}")
    return v.value


def _disi(s: SelectionContext, i: Instr) -> None:
    s.emit("disi", Imm(_constant(i, 0, 0x3FFF)))


def _begin_atomic(s: SelectionContext, i: Instr) -> None:
    s.emit("begin_atomic").also_defs = (0,)


def _end_atomic(s: SelectionContext, i: Instr) -> None:
    s.emit("end_atomic")


def _text(*lines: str) -> Handler:
    def expand(s: SelectionContext, i: Instr) -> None:
        for line in lines:
            s.emit("text", line)

    return expand


def _pwrsav(s: SelectionContext, i: Instr) -> None:
    s.emit("text", f"pwrsav #{_constant(i, 0, 1)}")


def _osccon(byte: str, keys: tuple[int, int]) -> Handler:
    """Return the handler that writes two keys and the value to OSCCON by three consecutive byte moves."""

    def expand(s: SelectionContext, i: Instr) -> None:
        value = s.reg(i.args[0])
        pointer, first, second = s.temp(), s.temp(), s.temp()
        s.emit("mov", Imm("_OSCCON" if byte == "L" else "_OSCCON+1"), pointer)
        s.emit("mov", Imm(keys[0]), first)
        s.emit("mov", Imm(keys[1]), second)
        mi = s.emit("asm", first, second, value, pointer)
        mi.info = opaque("ssss", words=3)
        mi.text = "mov.b \x000:\x00,[\x003:\x00]\nmov.b \x001:\x00,[\x003:\x00]\nmov.b \x002:\x00,[\x003:\x00]"

    return expand


def _write_nvm(s: SelectionContext, i: Instr) -> None:
    """Select: write 0x55 and 0xAA to NVMKEY, set WR, two NOPs (abi-elf.md §2.9)."""
    for key in (0x55, 0xAA):
        r = s.temp()
        s.load_imm(key, r)
        s.copy(r, 0)
        mi = s.emit("asm", 0)
        mi.info = opaque("s")
        mi.text = "mov \x000:\x00,_NVMKEY"
    _text("bset _NVMCON,#15", "nop", "nop")(s, i)


def _table_read(op: str, byte: bool) -> Handler:
    def expand(s: SelectionContext, i: Instr) -> None:
        s.emit(op, Mem("ind", s.reg(i.args[0])), s.value_regs(i)[0], byte=byte)

    return expand


def _table_write(op: str, byte: bool) -> Handler:
    def expand(s: SelectionContext, i: Instr) -> None:
        s.emit(op, s.reg(i.args[1]), Mem("ind", s.reg(i.args[0])), byte=byte)

    return expand


def _address_part(operator: str) -> Handler:
    def expand(s: SelectionContext, i: Instr) -> None:
        v = i.args[0]
        if not isinstance(v, GlobalRef):
            raise UnsupportedError(f"{i.extra['name']}: the argument must be the address of an object or function")
        name = symbol(s.module, v.name)
        at = f"{name}+{v.offset}" if v.offset else name
        s.emit("mov", Imm(f"{operator}({at})"), s.value_regs(i)[0])

    return expand


def _multiply(kind: str) -> Handler:
    def expand(s: SelectionContext, i: Instr) -> None:
        low, high = s.value_regs(i)
        p = s.m.new_pair()
        s.emit(f"mul.{kind}", s.reg(i.args[0]), s.reg(i.args[1]), p)
        s.emit("split", low, high, p)

    return expand


def _divide(op: str, result: int) -> Handler:
    """Return the handler for a division of 32 by 16 bits: REPEAT #17, DIV.SD or DIV.UD; result in W0 or W1."""

    def expand(s: SelectionContext, i: Instr) -> None:
        low, high = s.regs(i.args[0])
        n = s.reg(i.args[1])
        p = s.m.new_pair()
        s.emit("join", p, low, high)
        mi = s.emit(op, p, n)
        mi.also_defs = (0, 1)
        mi.late = (1,)
        s.copy(result, s.value_regs(i)[0])

    return expand


def _bit_toggle(s: SelectionContext, i: Instr) -> None:
    s.emit("btg", Mem("ind", s.reg(i.args[0])), Imm(_constant(i, 1, 15)))


def _get_isr_state(s: SelectionContext, i: Instr) -> None:
    """Select the value of SR.IPL, bits 7-5 of SR."""
    r, t = s.temp(), s.temp()
    mi = s.emit("asm", r)
    mi.info = opaque("d")
    mi.text = "mov _SR,\x000:\x00"
    s.emit("lsr", r, Imm(5), t)
    s.emit("and", t, Imm(7), s.value_regs(i)[0])


def _set_isr_state(s: SelectionContext, i: Instr) -> None:
    """Select a write of SR.IPL; the flags in the low bits of SR are overwritten."""
    r = s.temp()
    s.emit("sl", s.reg(i.args[0]), Imm(5), r)
    s.copy(r, 0)
    mi = s.emit("asm", 0)
    mi.info = opaque("s", "cznv")
    mi.text = "mov.b WREG,_SR"


def _failed_check(s: SelectionContext, i: Instr) -> None:
    for line in (f".pword {HALT:#08x}", "reset", f".pword {FAILED_CHECK | _constant(i, 0, 0xFF):#08x}"):
        s.emit("text", line)


BUILTINS: dict[str, Handler] = {
    "disi": _disi,
    "begin_atomic": _begin_atomic,
    "end_atomic": _end_atomic,
    "nop": _text("nop"),
    "clrwdt": _text("clrwdt"),
    "pwrsav": _pwrsav,
    "software_breakpoint": _text(f".pword {HALT:#08x}"),
    "failed_check": _failed_check,
    "reset": _text("reset"),
    "write_OSCCONL": _osccon("L", (0x46, 0x57)),
    "write_OSCCONH": _osccon("H", (0x78, 0x9A)),
    "write_NVM": _write_nvm,
    "tblrdl": _table_read("tblrdl", False),
    "tblrdh": _table_read("tblrdh", False),
    "tblrdlb": _table_read("tblrdl", True),
    "tblrdhb": _table_read("tblrdh", True),
    "tblwtl": _table_write("tblwtl", False),
    "tblwth": _table_write("tblwth", False),
    "tblwtlb": _table_write("tblwtl", True),
    "tblwthb": _table_write("tblwth", True),
    "tblpage": _address_part("tblpage"),
    "tbloffset": _address_part("tbloffset"),
    "psvpage": _address_part("psvpage"),
    "psvoffset": _address_part("psvoffset"),
    "mulss": _multiply("ss"),
    "muluu": _multiply("uu"),
    "mulsu": _multiply("su"),
    "mulus": _multiply("us"),
    "divsd": _divide("div.sd", 0),
    "divud": _divide("div.ud", 0),
    "modsd": _divide("div.sd", 1),
    "modud": _divide("div.ud", 1),
    "btg": _bit_toggle,
    "get_isr_state": _get_isr_state,
    "set_isr_state": _set_isr_state,
}


def select_builtin(s: SelectionContext, i: Instr) -> None:
    """Select one builtin. Raises UnsupportedError for unknown names."""
    name = i.extra["name"].removeprefix("__builtin_")
    handler = BUILTINS.get(name)
    if handler is None:
        raise UnsupportedError(f"builtin function __builtin_{name}")
    handler(s, i)
