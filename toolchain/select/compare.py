"""Selection of comparisons and truth values."""

from __future__ import annotations

from toolchain.abi.target import LIT10_BYTE_MAX, LIT10_MAX
from toolchain.ir.build import SWAPPED
from toolchain.ir.model import I1, ConstInt, Instr, Undef, Value
from toolchain.mir.mir import CC_INVERSE, MI, Imm
from toolchain.select.context import Handler, SelectionContext
from toolchain.select.rules import CONDITION

# Comparisons with 0 that CP0 answers, N being the sign because CP0 clears OV (isa.md §6.1).
ZERO_CONDITION = {"eq": "z", "ne": "nz", "slt": "n", "sge": "nn", "sgt": "gt", "sle": "le", "ugt": "nz", "ule": "z"}


# Tests of x against 0 by the flags of x - 1: DEC borrows exactly for 0, and N^OV is the sign of the true difference.
# Against 1 they say what they say of the result.
COUNTED = (
    {"eq": "nc", "ne": "c", "sle": "lt", "sgt": "ge"},
    {"eq": "z", "ne": "nz", "sle": "le", "sgt": "gt", "ule": "leu", "ugt": "gtu"},
)


def condition(s: SelectionContext, c: Value, user: Instr) -> str:
    """Emit a comparison for the truth of `c` and return the branch condition."""
    if isinstance(c, Instr) and c.op == "icmp" and s.same_block(c):
        step = _countdown(s, c) if user.op == "br" else None
        if step is not None:
            s.folded.add(id(step))
            s.emit("dec", s.reg(step.args[0]), s.value_regs(step)[0], byte=step.type.bits == 8)
            against = c.args[1]
            assert isinstance(against, ConstInt)
            return COUNTED[against.value][c.pred]
        return compare(s, c, user)
    if isinstance(c, Instr) and c.op == "xor" and c.type is I1 and isinstance(c.args[1], ConstInt):
        inner = condition(s, c.args[0], user)
        return CC_INVERSE[inner] if c.args[1].value else inner
    s.emit("cp0", s.reg(c), byte=True)
    return "nz"


def _countdown(s: SelectionContext, c: Instr) -> Instr | None:
    """y = x - 1 of this block, wanted only after it, for a test of x against 0 or 1."""
    x, against = c.args
    if not isinstance(against, ConstInt) or against.value > 1 or c.pred not in COUNTED[against.value]:
        return None
    if x.type.bits not in (8, 16) or c.type is not I1:
        return None
    for y in s.users.get(id(x), ()):
        if y.op == "add" and isinstance(y.args[1], ConstInt) and y.args[1].signed == -1 and s.same_block(y):
            inside = [u for u in s.users.get(id(y), ()) if u.op != "phi" and s.same_block(u)]
            if not inside and id(y) in s.needed and id(y) not in s.folded:
                return y
    return None


def compare(s: SelectionContext, c: Instr, at: Instr) -> str:
    """CP or a relative of it, emitted at `at`; returns the condition under which the icmp holds.

    A comparison may be repeated at several users, so loads fold into it only when it has one.
    """
    a, b = c.args
    pred = c.pred
    bits = a.type.bits
    if isinstance(a, ConstInt) or (s.is_leaf(a) and not s.is_leaf(b)):
        a, b, pred = b, a, SWAPPED[pred]
    if bits > 16:
        return _compare_wide(s, a, b, pred)
    byte = bits <= 8
    fold = at if s.single_use(c) else None
    if isinstance(b, Undef):
        return CONDITION[pred]
    if isinstance(b, ConstInt):
        return _compare_constant(s, a, b, pred, byte, fold)
    if fold is not None and s.foldable_load(a, fold) is not None and s.foldable_load(b, fold) is None:
        a, b, pred = b, a, SWAPPED[pred]
    right = s.source(b, fold) if fold is not None else s.reg(b)
    s.emit("cp", s.reg(a), right, byte=byte)
    return CONDITION[pred]


def _compare_constant(s: SelectionContext, a: Value, b: ConstInt, pred: str, byte: bool, fold: Instr | None) -> str:
    k, bits = b.value, max(b.type.bits, 8)
    ones = (1 << bits) - 1
    if pred in ("slt", "sge") and k == 1:
        pred, k = ("sle" if pred == "slt" else "sgt"), 0
    elif pred in ("sgt", "sle") and k == ones:
        pred, k = ("sge" if pred == "sgt" else "slt"), 0
    elif pred in ("ult", "uge") and k == 1:
        pred, k = ("eq" if pred == "ult" else "ne"), 0
    elif pred in ("ugt", "ule") and k < 31 and k + 1 <= ones:
        pred, k = ("uge" if pred == "ugt" else "ult"), k + 1
    elif pred in ("sgt", "sle") and k < 31:
        pred, k = ("sge" if pred == "sgt" else "slt"), k + 1
    if k == 0 and pred in ZERO_CONDITION:
        return _compare_zero(s, a, pred, byte, fold)
    if k <= 31:
        s.emit("cp", s.reg(a), Imm(k), byte=byte)
    elif -k & ones <= 31:  # a + (-k) leaves the flags of a - k, but for 0 and the least number
        s.emit("add", s.reg(a), Imm(-k & ones), s.temp(), byte=byte)
    else:
        t = s.temp()
        right = s.source(a, fold) if fold is not None else s.reg(a)
        if not isinstance(right, int):
            s.load_imm(k, t)
            s.emit("cp", t, right, byte=byte)
            pred = SWAPPED[pred]
        elif fold is None or fold.op != "br" or not s.single_use(a) or not _subtract(s, right, k, bits, t):
            s.load_imm(k, t)
            s.emit("cp", right, t, byte=byte)
    return CONDITION[pred]


def _subtract(s: SelectionContext, a: int, k: int, bits: int, t: int) -> bool:
    """The flags of a - k by a two-address instruction, which spoils t, a copy of a, and needs no register for k."""
    negative = -k & ((1 << bits) - 1)
    most = LIT10_BYTE_MAX if bits == 8 else LIT10_MAX
    if min(k, negative) > most:
        return False
    s.copy(a, t)
    s.emit("subl" if k <= most else "addl", Imm(k if k <= most else negative), t, byte=bits == 8)
    return True


def _compare_zero(s: SelectionContext, a: Value, pred: str, byte: bool, fold: Instr | None) -> str:
    """Against 0: bit tests, near objects, CP0."""
    if fold is None:
        s.emit("cp0", s.reg(a), byte=byte)
        return ZERO_CONDITION[pred]
    if pred in ("eq", "ne") and _is_mask(s, a) and isinstance(a, Instr) and s.same_block(a) and _test_bits(s, a, fold):
        return CONDITION[pred]
    operand = s.near_operand(a, fold)
    if operand is not None:
        s.emit("cp0f", operand, byte=byte)
    else:
        s.emit("cp0", s.source(a, fold), byte=byte)
    return ZERO_CONDITION[pred]


def _is_mask(s: SelectionContext, a: Value) -> bool:
    """x & constant, with no other user."""
    return isinstance(a, Instr) and a.op == "and" and s.single_use(a) and isinstance(a.args[1], ConstInt)


def _test_bits(s: SelectionContext, a: Instr, at: Instr) -> bool:
    """BTST for one bit of a register or near object."""
    mask = a.args[1]
    assert isinstance(mask, ConstInt)
    if mask.value and mask.value & (mask.value - 1) == 0:
        bit = mask.value.bit_length() - 1
        near = s.near_operand(a.args[0], at)
        if near is not None:
            s.emit("btstf", near, Imm(bit), byte=a.type.bits == 8)
        else:
            s.emit("btst", s.source(a.args[0], at) if a.type.bits == 16 else s.reg(a.args[0]), Imm(bit))
        return True
    return False


def _compare_wide(s: SelectionContext, a: Value, b: Value, pred: str) -> str:
    """Several words: CP, then CPB; Z is sticky (isa.md §6.1)."""
    left = s.regs(a)
    if isinstance(b, ConstInt):
        if b.value == 0 and pred in ("eq", "ne"):
            _or_words(s, left)
            return CONDITION[pred]
        if (b.value == 0 and pred in ("slt", "sge")) or (b.signed == -1 and pred in ("sgt", "sle")):
            s.emit("cp0", left[-1])
            return "n" if pred in ("slt", "sle") else "nn"
    op = "cp"
    for k, x in enumerate(left):
        if isinstance(b, ConstInt):
            word = b.value >> 16 * k & 0xFFFF
            if word <= 31:
                s.emit(op, x, Imm(word))
            else:
                t = s.temp()
                s.load_imm(word, t)
                s.emit(op, x, t)
        else:
            s.emit(op, x, s.regs(b)[k] if k == 0 or not s.is_leaf(b) else s.leaf_word(b, k))
        op = "cpb"
    return CONDITION[pred]


def _or_words(s: SelectionContext, words: tuple[int, ...]) -> None:
    """Z says whether all words are 0."""
    total = words[0]
    for x in words[1:]:
        t = s.temp()
        s.emit("ior", total, x, t)
        total = t


def select_icmp(s: SelectionContext, i: Instr) -> None:
    """A truth value: by the carry where it answers, else 1 unless the condition fails."""
    d = s.result(i)
    a, b = i.args
    if i.pred == "slt" and isinstance(b, ConstInt) and b.value == 0:
        _sign_bit(s, a, d)
        return
    zero = isinstance(b, ConstInt) and b.value == 0 and i.pred in ("eq", "ne") and a.type.bits in (8, 16)
    if zero and not _is_mask(s, a):
        s.emit("cp", s.reg(a), Imm(1), byte=a.type.bits == 8)  # borrows exactly for 0
        _from_carry(s, "nc" if i.pred == "eq" else "c", d)
        return
    cc = compare(s, i, i)
    if cc in ("c", "nc"):
        _from_carry(s, cc, d)
        return
    before = len(s.out)
    s.emit("mov", Imm(1), d)
    if _skippable(s.out[before - 1], cc):
        s.out[before - 1 :] = [s.out[before], s.out[before - 1]]
    s.emit("skip", "", cc=cc)
    s.emit("clr", d).pred = True


def _from_carry(s: SelectionContext, cc: str, d: int) -> None:
    """d = C, or d = !C as the negated borrow of d - d."""
    if cc == "c":
        zero = s.temp()
        s.emit("clr", zero)
        s.emit("rlc", zero, d)
    else:
        t = s.temp()
        s.emit("borrow", t)
        s.emit("neg", t, d)


def _skippable(mi: MI, cc: str) -> bool:
    """Whether the comparison can become a skip instruction, which must stand next to what it guards."""
    if mi.op in ("btst", "btstf"):
        return True
    return mi.op == "cp" and cc in ("z", "nz", "lt", "gt") and all(isinstance(a, int) for a in mi.args)


def _sign_bit(s: SelectionContext, a: Value, d: int) -> None:
    """a < 0 as 0 or 1."""
    top = s.regs(a)[-1]
    if a.type.bits == 8:
        wide = s.temp()
        s.emit("se", top, wide)
        top = wide
    s.emit("lsr", top, Imm(15), d)


HANDLERS: dict[str, Handler] = {"icmp": select_icmp}
