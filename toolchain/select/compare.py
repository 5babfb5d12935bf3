"""Selection of comparisons, for branch conditions and as truth values."""

from __future__ import annotations

from toolchain.abi.target import LIT5_MAX, LIT10_BYTE_MAX, LIT10_MAX
from toolchain.ir.build import SWAPPED
from toolchain.ir.model import I1, ConstInt, Instr, Undef, Value
from toolchain.mir.instruction import MI
from toolchain.mir.operands import Imm
from toolchain.mir.operations import CC_INVERSE
from toolchain.select.context import Handler, SelectionContext
from toolchain.select.rules import CONDITION

# Condition after CP0 by predicate of a comparison with 0. N is the sign, because CP0 clears OV (isa.md §6.1).
ZERO_CONDITION = {"eq": "z", "ne": "nz", "slt": "n", "sge": "nn", "sgt": "gt", "sle": "le", "ugt": "nz", "ule": "z"}


# Condition after DEC of x by comparison of x with 0 or 1. DEC borrows only for x = 0, and N^OV is the sign of the exact
# difference. A comparison of x with 1 is a comparison of the result with 0.
COUNTDOWN_CONDITION = (
    {"eq": "nc", "ne": "c", "sle": "lt", "sgt": "ge"},
    {"eq": "z", "ne": "nz", "sle": "le", "sgt": "gt", "ule": "leu", "ugt": "gtu"},
)


def condition(s: SelectionContext, c: Value, user: Instr) -> str:
    """Emit a comparison that decides `c` and return the branch condition."""
    if isinstance(c, Instr) and c.op == "icmp" and s.same_block(c):
        step = _countdown(s, c) if user.op == "br" else None
        if step is not None:
            s.folded.add(id(step))
            s.emit("dec", s.reg(step.args[0]), s.value_regs(step)[0], byte=step.type.bits == 8)
            against = c.args[1]
            assert isinstance(against, ConstInt)
            return COUNTDOWN_CONDITION[against.value][c.pred]
        return compare(s, c, user)
    if isinstance(c, Instr) and c.op == "xor" and c.type is I1 and isinstance(c.args[1], ConstInt):
        inner = condition(s, c.args[0], user)
        return CC_INVERSE[inner] if c.args[1].value else inner
    s.emit("cp0", s.reg(c), byte=True)
    return "nz"


def _countdown(s: SelectionContext, c: Instr) -> Instr | None:
    """For a comparison of x with 0 or 1, the decrement x - 1 of this block that only later code uses; else None."""
    x, against = c.args
    if not isinstance(against, ConstInt) or against.value > 1 or c.pred not in COUNTDOWN_CONDITION[against.value]:
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
    """Emit a comparison for icmp `c` at its user `at`; return the condition under which it is true.

    The comparison is repeated for every user, so loads fold into it only if it has one.
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
    """Compare with a constant; return the condition. Loads fold into the user `fold`, if given."""
    bits = max(b.type.bits, 8)
    ones = (1 << bits) - 1
    pred, k = _canonical(pred, b.value, ones)
    if k == 0 and pred in ZERO_CONDITION:
        return _compare_zero(s, a, pred, byte, fold)
    if k <= LIT5_MAX:
        s.emit("cp", s.reg(a), Imm(k), byte=byte)
        return CONDITION[pred]
    if -k & ones <= LIT5_MAX:  # a + (-k) sets the same flags as a - k, except for k = 0 and the most negative number
        s.emit("add", s.reg(a), Imm(-k & ones), s.temp(), byte=byte)
        return CONDITION[pred]
    t = s.temp()
    right = s.source(a, fold) if fold is not None else s.reg(a)
    if not isinstance(right, int):
        s.load_imm(k, t)
        s.emit("cp", t, right, byte=byte)
        return CONDITION[SWAPPED[pred]]
    last_use = fold is not None and fold.op == "br" and s.single_use(a)
    if not (last_use and _subtract(s, right, k, bits, t)):
        s.load_imm(k, t)
        s.emit("cp", right, t, byte=byte)
    return CONDITION[pred]


def _canonical(pred: str, k: int, ones: int) -> tuple[str, int]:
    """An equivalent comparison with a constant: with 0 if possible, and `<` or `>=` instead of `<=` and `>`."""
    if pred in ("slt", "sge") and k == 1:
        return ("sle" if pred == "slt" else "sgt"), 0
    if pred in ("sgt", "sle") and k == ones:
        return ("sge" if pred == "sgt" else "slt"), 0
    if pred in ("ult", "uge") and k == 1:
        return ("eq" if pred == "ult" else "ne"), 0
    if pred in ("ugt", "ule") and k < LIT5_MAX and k + 1 <= ones:
        return ("uge" if pred == "ugt" else "ult"), k + 1
    if pred in ("sgt", "sle") and k < LIT5_MAX:
        return ("sge" if pred == "sgt" else "slt"), k + 1
    return pred, k


def _subtract(s: SelectionContext, a: int, k: int, bits: int, t: int) -> bool:
    """Set the flags of a - k by SUB #k on a copy t of a, without a register for k; False if k is too large."""
    negative = -k & ((1 << bits) - 1)
    most = LIT10_BYTE_MAX if bits == 8 else LIT10_MAX
    if min(k, negative) > most:
        return False
    s.copy(a, t)
    s.emit("subl" if k <= most else "addl", Imm(k if k <= most else negative), t, byte=bits == 8)
    return True


def _compare_zero(s: SelectionContext, a: Value, pred: str, byte: bool, fold: Instr | None) -> str:
    """Compare with 0 by a bit test, in near memory, or by CP0; return the condition."""
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
    """Whether a value is x & constant without another user."""
    return isinstance(a, Instr) and a.op == "and" and s.single_use(a) and isinstance(a.args[1], ConstInt)


def _test_bits(s: SelectionContext, a: Instr, at: Instr) -> bool:
    """Emit BTST if the mask of `a` has one bit; return whether it has."""
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
    """Compare several words by CP and CPB, which has a sticky Z (isa.md §6.1); return the condition."""
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
    """Emit an OR of all words, which sets Z if all are 0."""
    total = words[0]
    for x in words[1:]:
        t = s.temp()
        s.emit("ior", total, x, t)
        total = t


def select_icmp(s: SelectionContext, i: Instr) -> None:
    """Select icmp as a value: the carry if possible, else 1 that is cleared under a skip."""
    d = s.result(i)
    a, b = i.args
    if i.pred == "slt" and isinstance(b, ConstInt) and b.value == 0:
        _sign_bit(s, a, d)
        return
    zero = isinstance(b, ConstInt) and b.value == 0 and i.pred in ("eq", "ne") and a.type.bits in (8, 16)
    if zero and not _is_mask(s, a):
        s.emit("cp", s.reg(a), Imm(1), byte=a.type.bits == 8)  # borrows only for 0
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
    """Emit d = C, or d = !C as the negated result of d - d with borrow."""
    if cc == "c":
        zero = s.temp()
        s.emit("clr", zero)
        s.emit("rlc", zero, d)
    else:
        t = s.temp()
        s.emit("borrow", t)
        s.emit("neg", t, d)


def _skippable(mi: MI, cc: str) -> bool:
    """Whether a comparison can become a skip instruction, which must directly precede the covered instruction."""
    if mi.op in ("btst", "btstf"):
        return True
    return mi.op == "cp" and cc in ("z", "nz", "lt", "gt") and all(isinstance(a, int) for a in mi.args)


def _sign_bit(s: SelectionContext, a: Value, d: int) -> None:
    """Emit d = 1 if a < 0, else 0."""
    top = s.regs(a)[-1]
    if a.type.bits == 8:
        wide = s.temp()
        s.emit("se", top, wide)
        top = wide
    s.emit("lsr", top, Imm(15), d)


HANDLERS: dict[str, Handler] = {"icmp": select_icmp}
