"""Selection of shifts of any width by constants and variables."""

from __future__ import annotations

from toolchain.ir.model import ConstInt, Instr, Value
from toolchain.mir.instruction import MI
from toolchain.mir.operands import Imm
from toolchain.mir.operations import OpInfo
from toolchain.select.context import Handler, SelectionContext
from toolchain.select.state import words_of

MAX_MULTIPLIED_SHIFT = 4  # maximum shift count as a product; MUL has literals below 32


def select_shift(s: SelectionContext, i: Instr) -> None:
    """Select shl, lshr and ashr of any width, by constants or variables."""
    a, n = i.args
    if isinstance(n, ConstInt):
        if words_of(i) == 1:
            _shift_word(s, i, n.value)
        else:
            _shift_wide_constant(s, i.op, s.regs(a), n.value, s.value_regs(i))
    elif words_of(i) == 1:
        _shift_word_variable(s, i)
    elif _low_word_suffices(s, i):
        s.emit("sl", s.regs(a)[0], s.regs(n)[0], s.value_regs(i)[0])
    else:
        _shift_wide_variable(s, i)


SHIFT_OP = {"shl": "sl", "lshr": "lsr", "ashr": "asr"}


def _extended_byte(s: SelectionContext, v: Value, signed: bool, user: Instr) -> int:
    """Register with a byte value extended to a word."""
    r = s.temp()
    s.emit("se" if signed else "ze", s.source(v, user), r)
    return r


def _shift_word(s: SelectionContext, i: Instr, n: int) -> None:
    d, byte = s.result(i), i.type.bits == 8
    if n >= i.type.bits:
        s.emit("clr", d)
        return
    if byte and i.op != "shl":
        if n == 1:
            s.emit("lsr1" if i.op == "lshr" else "asr1", s.source(i.args[0], i), d, byte=True)
            return
        wide = _extended_byte(s, i.args[0], i.op == "ashr", i)
        s.emit(SHIFT_OP[i.op], wide, Imm(n), d)
        return
    if n == 1 and not byte:
        s.emit(SHIFT_OP[i.op] + "1", s.source(i.args[0], i), d)
        return
    s.emit(SHIFT_OP[i.op], s.reg(i.args[0]), Imm(n), d)


def _shift_word_variable(s: SelectionContext, i: Instr) -> None:
    """Select the shift of a word by a variable; counts of 16 and more are undefined in the IR."""
    d, byte = s.result(i), i.type.bits == 8
    a = _extended_byte(s, i.args[0], i.op == "ashr", i) if byte and i.op != "shl" else s.reg(i.args[0])
    s.emit(SHIFT_OP[i.op], a, s.reg(i.args[1]), d)


def _low_word_suffices(s: SelectionContext, i: Instr) -> bool:
    """Whether only the low word of a left shift of two words is used; SL yields 0 for counts 16-31 (isa.md §6.3)."""
    if i.op != "shl" or words_of(i) != 2:
        return False
    return all(user.op == "trunc" and words_of(user) == 1 for user in s.users[id(i)])


def _shift_wide_constant(s: SelectionContext, op: str, a: tuple[int, ...], n: int, d: tuple[int, ...]) -> None:
    """Shift several words by a constant: move whole words, then shift with the bits of the neighbouring words."""
    count = len(a)
    jump, bits = n // 16, n % 16
    if jump >= count:
        for r in d:
            s.emit("clr", r)
        return
    if bits == 0:
        _move_words(s, op, a, jump, d)
    elif bits == 1 and jump == 0:
        _shift_by_one(s, op, a, d)
    elif count == 2 and op == "shl" and bits <= MAX_MULTIPLIED_SHIFT and jump == 0:
        _shift_by_product(s, a, bits, d)
    elif count == 2 and op != "shl" and n == 8:
        _shift_by_byte(s, op, a, d)
    elif op == "shl":
        for k in range(count - 1, -1, -1):
            if k < jump:
                s.emit("clr", d[k])
            elif k == jump:
                s.emit("sl", a[0], Imm(bits), d[k])
            else:
                _combine(s, "sl", a[k - jump], bits, "lsr", a[k - jump - 1], d[k])
    else:
        top = count - 1
        for k in range(count):
            if k + jump > top:
                fill(s, op, a[top], d[k])
            elif k + jump == top:
                s.emit(SHIFT_OP[op], a[top], Imm(bits), d[k])
            else:
                _combine(s, "lsr", a[k + jump], bits, "sl", a[k + jump + 1], d[k])


def _shift_by_product(s: SelectionContext, a: tuple[int, ...], bits: int, d: tuple[int, ...]) -> None:
    """Shift two words left: the upper word of the product low * 2^bits contains the bits that move to the next word."""
    upper, crossing, p = s.temp(), s.temp(), s.m.new_pair()
    s.emit("sl", a[1], Imm(bits), upper)
    s.emit("mul.uu", a[0], Imm(1 << bits), p)
    s.emit("split", d[0], crossing, p)
    s.emit("ior", crossing, upper, d[1])


def _shift_by_byte(s: SelectionContext, op: str, a: tuple[int, ...], d: tuple[int, ...]) -> None:
    """Shift two words right by 8: replace the low byte of the low word by that of the high word, then swap bytes."""
    s.copy(a[0], d[0])
    s.emit("movlow", a[1], d[0], byte=True)
    s.emit("swap", d[0])
    s.emit(SHIFT_OP[op], a[1], Imm(8), d[1])


def _combine(s: SelectionContext, op: str, main: int, bits: int, other_op: str, other: int, d: int) -> None:
    """Emit d = main shifted by `bits`, combined with the neighbour word shifted in the other direction."""
    x, y = s.temp(), s.temp()
    s.emit(op, main, Imm(bits), x)
    s.emit(other_op, other, Imm(16 - bits), y)
    s.emit("ior", x, y, d)


def fill(s: SelectionContext, op: str, top: int, d: int) -> None:
    """Emit the word above a value: zero, or for ashr the sign of the value's top word."""
    if op == "ashr":
        s.emit("asr", top, Imm(15), d)
    else:
        s.emit("clr", d)


def _move_words(s: SelectionContext, op: str, a: tuple[int, ...], jump: int, d: tuple[int, ...]) -> None:
    count = len(a)
    for k in range(count):
        source = k - jump if op == "shl" else k + jump
        if 0 <= source < count:
            s.copy(a[source], d[k])
        elif op == "shl":
            s.emit("clr", d[k])
        else:
            fill(s, op, a[count - 1], d[k])


def _shift_by_one(s: SelectionContext, op: str, a: tuple[int, ...], d: tuple[int, ...]) -> None:
    """Shift by one through the carry: SL and RLC upwards, LSR or ASR and RRC downwards (abi-elf.md §8.1)."""
    if op == "shl":
        for k in range(len(a)):
            s.emit("sl1" if k == 0 else "rlc", a[k], d[k])
        return
    top = len(a) - 1
    for k in range(top, -1, -1):
        s.emit(("asr1" if op == "ashr" else "lsr1") if k == top else "rrc", a[k], d[k])


def _shift_wide_variable(s: SelectionContext, i: Instr) -> None:
    """Shift several words by a variable in a loop of one-bit shifts (abi-elf.md §8.1: 5 words for 32 bits)."""
    d = s.value_regs(i)
    a = s.regs(i.args[0])
    n = s.regs(i.args[1])[0]
    count = s.temp()
    for x, r in zip(a, d, strict=True):
        s.copy(x, r)
    s.copy(n, count)
    mi = MI("shiftloop", i.op, count, *d, line=s.line)
    mi.info = OpInfo("nb" + "b" * len(d), "cznv", words=len(d) + 3)
    s.out.append(mi)


HANDLERS: dict[str, Handler] = {
    **dict.fromkeys(("shl", "lshr", "ashr"), select_shift),
}
