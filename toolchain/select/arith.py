"""Selection of addition, subtraction, logic and width changes."""

from __future__ import annotations

from toolchain.ir.model import I1, ConstInt, Instr, Value
from toolchain.mir.operands import Imm, Mem
from toolchain.select.context import Handler, SelectionContext
from toolchain.select.rules import CARRY_OP, COMMUTES, REGISTER_OP, ImmediateRule, immediate_rule
from toolchain.select.shifts import fill
from toolchain.select.state import words_of


def select_binary(s: SelectionContext, i: Instr) -> None:
    """Select addition, subtraction, logic: with an immediate, with a folded load, or word by word with carry."""
    if _into_low_byte(s, i):
        return
    if words_of(i) > 1:
        _wide_binary(s, i)
        return
    a, b = i.args
    byte = i.type.bits == 8
    d = s.result(i)
    if isinstance(a, ConstInt) and i.op == "sub":
        _reverse_subtract(s, i, a, d, byte)
        return
    if isinstance(b, ConstInt):
        if _file_logic(s, i, a, b, d, byte):
            return
        if i.op == "sub":
            apply_immediate(s, "add", a, -b.value & ((1 << i.type.bits) - 1), d, byte, i)
        else:
            apply_immediate(s, i.op, a, b.value, d, byte, i)
        return
    op = REGISTER_OP[i.op]
    if i.op in COMMUTES and s.foldable_load(a, i) is not None and s.foldable_load(b, i) is None:
        a, b = b, a
    right = s.source(b, i)
    if i.op == "sub" and isinstance(right, int):
        left = s.source(a, i)
        if not isinstance(left, int):
            s.emit("subr", right, left, d, byte=byte)
            return
        s.emit(op, left, right, d, byte=byte)
        return
    s.emit(op, s.reg(a), right, d, byte=byte)


def _into_low_byte(s: SelectionContext, i: Instr) -> bool:
    """Select a | b and a ^ b for an extended byte b as a byte operation, which needs no extension."""
    if i.op not in ("or", "xor") or i.type.bits < 16:
        return False
    for a, b in (i.args, i.args[::-1]):
        narrow = b.args[0] if isinstance(b, Instr) and b.op == "zext" else None
        if narrow is None or narrow.type.bits != 8 or s.is_leaf(narrow) or s.is_leaf(a):
            continue
        assert isinstance(b, Instr)
        if not s.single_use(b) or id(b) in s.register_values or not s.same_block(b):
            continue
        d = s.value_regs(i)
        source = s.source(narrow, i)
        for x, r in zip(s.value_regs(a), d, strict=True):
            s.copy(x, r)
        s.emit(REGISTER_OP[i.op] + "low", d[0], source, byte=True)
        return True
    return False


def _file_logic(s: SelectionContext, i: Instr, a: Value, b: ConstInt, d: int, byte: bool) -> bool:
    """Select (near object) op constant through W0; loading both takes one word more (abi-elf.md §8.1, bit-fields)."""
    if i.op not in ("and", "or", "xor") or immediate_rule(i.op, b.value, i.type.bits) is not None:
        return False
    near = s.near_operand(a, i)
    if near is None:
        return False
    s.load_imm(b.value, 0)
    s.emit(REGISTER_OP[i.op] + "w", near, 0, byte=byte)
    s.copy(0, d)
    return True


def _reverse_subtract(s: SelectionContext, i: Instr, a: ConstInt, d: int, byte: bool) -> None:
    """Select constant - b."""
    right = s.source(i.args[1], i)
    if a.value == 0:
        s.emit("neg", right, d, byte=byte)
    elif a.value <= 31 and isinstance(right, int):
        s.emit("subr", right, Imm(a.value), d, byte=byte)
    elif a.value == (1 << i.type.bits) - 1:
        s.emit("com", right, d, byte=byte)
    else:
        s.emit("sub", s.reg(a), right, d, byte=byte)


def apply_immediate(s: SelectionContext, op: str, a: Value, k: int, d: int, byte: bool, user: Instr | None) -> None:
    """Emit d = a op k by the first matching rule, else with the constant in a register."""
    rule = immediate_rule(op, k, 8 if byte else 16)
    if rule is not None and rule.form == "unary" and user is not None and rule.op != "ze":
        s.emit(rule.op, s.source(a, user), d, byte=byte)
        return
    apply_rule(s, rule, op, s.reg(a), k, d, byte)


def apply_rule(s: SelectionContext, rule: ImmediateRule | None, op: str, a: int, k: int, d: int, byte: bool) -> None:
    """Emit d = a op k for a register a; without a rule, the constant is loaded into a register."""
    if rule is None:
        t = s.temp()
        s.load_imm(k, t)
        s.emit(REGISTER_OP[op], a, t, d, byte=byte)
        return
    literal = Imm(rule.literal(k, 8 if byte else 16))
    if rule.form == "unary":
        s.emit(rule.op, a, d, byte=byte and rule.op != "ze")
    elif rule.form == "lit5":
        s.emit(rule.op, a, literal, d, byte=byte)
    else:
        s.copy(a, d)
        if rule.form == "tied":
            s.emit(rule.op, literal, d, byte=byte)
        else:
            s.emit(rule.op, d, literal, byte=byte)


def _wide_binary(s: SelectionContext, i: Instr) -> None:
    """Select an operation on several words; words known to be zero become copies."""
    a, b = i.args
    d = s.value_regs(i)
    if isinstance(a, ConstInt) and i.op == "sub":
        _wide_reverse(s, i, a)
        return
    if isinstance(b, ConstInt):
        _wide_immediate(s, i.op, s.regs(a), b.value, d)
        return
    left, right = s.regs(a), s.regs(b)
    known = _known_zero_words(b) if i.op in ("or", "xor", "and") else set()
    known_a = _known_zero_words(a) if i.op in ("or", "xor", "and") else set()
    zero_b = _known_zero_words(b) if i.op in ("add", "sub") else set()
    for k, (x, y, r) in enumerate(zip(left, right, d, strict=True)):
        if k in zero_b and k:
            s.emit(CARRY_OP[i.op], x, Imm(0), r)
            continue
        if k in known or k in known_a:
            if i.op == "and":
                s.emit("clr", r)
            else:
                s.copy(x if k in known else y, r)
            continue
        s.emit(REGISTER_OP[i.op] if k == 0 else CARRY_OP[i.op], x, y, r)


def _known_zero_words(v: Value) -> set[int]:
    """Words of a value that are known to be 0: upper words of a zext, lower words of a shift by whole words."""
    if isinstance(v, Instr):
        if v.op == "zext":
            return set(range(words_of(v.args[0]), words_of(v)))
        if v.op == "shl" and isinstance(v.args[1], ConstInt):
            inner = _known_zero_words(v.args[0])
            n = v.args[1].value // 16
            lost = {k + n for k in inner} if v.args[1].value % 16 == 0 else set()
            return {k for k in set(range(n)) | lost if k < words_of(v)}
    return set()


def _wide_reverse(s: SelectionContext, i: Instr, a: ConstInt) -> None:
    """Select constant - b on several words."""
    right, d = s.regs(i.args[1]), s.value_regs(i)
    for k, (y, r) in enumerate(zip(right, d, strict=True)):
        word = a.value >> 16 * k & 0xFFFF
        op = "subr" if k == 0 else "subbr"
        if word <= 31:
            s.emit(op, y, Imm(word), r)
        else:
            t = s.temp()
            s.load_imm(word, t)
            s.emit(op, y, t, r)


def _wide_immediate(s: SelectionContext, op: str, a: tuple[int, ...], value: int, d: tuple[int, ...]) -> None:
    """Select an operation of several words with a constant; words for which it is neutral become copies."""
    words = [value >> 16 * k & 0xFFFF for k in range(len(a))]
    if op in ("add", "sub"):
        _wide_add_immediate(s, op, a, words, d)
        return
    for x, k, r in zip(a, words, d, strict=True):
        if (k == 0 and op != "and") or (k == 0xFFFF and op == "and"):
            s.copy(x, r)
        elif k == 0:
            s.emit("clr", r)
        elif k == 0xFFFF and op == "or":
            s.emit("setm", r)
        else:
            apply_rule(s, immediate_rule(op, k, 16), op, x, k, r, False)


def _wide_add_immediate(s: SelectionContext, op: str, a: tuple[int, ...], words: list[int], d: tuple[int, ...]) -> None:
    """Emit an addition or subtraction, whichever has more short literals; leading zero words become copies."""
    value = sum(w << 16 * k for k, w in enumerate(words))
    bits = 16 * len(words)
    negated = -value & ((1 << bits) - 1)
    other = [negated >> 16 * k & 0xFFFF for k in range(len(words))]
    if sum(w <= 31 for w in other) > sum(w <= 31 for w in words):
        words, op = other, "sub" if op == "add" else "add"
    carry = False
    for x, k, r in zip(a, words, d, strict=True):
        name = ("addc" if op == "add" else "subb") if carry else op
        if not carry and k == 0:
            s.copy(x, r)
            continue
        if k <= 31:
            s.emit(name, x, Imm(k), r)
        elif k <= 1023:
            s.copy(x, r)
            s.emit({"add": "addl", "sub": "subl", "addc": "addcl", "subb": "subbl"}[name], Imm(k), r)
        else:
            t = s.temp()
            s.load_imm(k, t)
            s.emit(name, x, t, r)
        carry = True


def select_extend(s: SelectionContext, i: Instr) -> None:
    """Select zext and sext. The result shares the registers of its source words."""
    v, signed = i.args[0], i.op == "sext"
    d = s.value_regs(i)
    if s.is_leaf(v):
        for k, r in enumerate(d):
            if k < words_of(v):
                s.load_leaf(v, k, r)
            else:
                fill(s, "ashr" if signed else "lshr", d[words_of(v) - 1], r)
        if v.type.bits == 8:
            s.emit("se" if signed else "ze", d[0], d[0])
        return
    if v.type is I1:
        if signed:
            s.emit("neg", s.reg(v), d[0])
            for r in d[1:]:
                s.copy(d[0], r)
        else:
            for r in d[1:]:
                s.emit("clr", r)
        return
    if v.type.bits == 8:
        s.emit("se" if signed else "ze", _byte_source(s, v, i), d[0])
        low = 1
    else:
        s.value_regs(v)
        low = words_of(v)
    for k in range(low, len(d)):
        if signed and k > low:
            s.copy(d[low], d[k])
        else:
            fill(s, "ashr" if signed else "lshr", d[low - 1], d[k])


def _byte_source(s: SelectionContext, v: Value, i: Instr) -> int | Mem:
    operand = s.source(v, i)
    assert isinstance(operand, int | Mem)
    return operand


def select_unary(s: SelectionContext, i: Instr) -> None:
    """Select FF1L and FF1R."""
    s.emit(i.op, s.source(i.args[0], i), s.result(i))


def select_swap(s: SelectionContext, i: Instr) -> None:
    """Select SWAP on a copy of the operand, because SWAP works in place."""
    d = s.result(i)
    s.copy(s.reg(i.args[0]), d)
    s.emit("swap", d)


HANDLERS: dict[str, Handler] = {
    **dict.fromkeys(("add", "sub", "and", "or", "xor"), select_binary),
    "zext": select_extend,
    "sext": select_extend,
    "ff1l": select_unary,
    "ff1r": select_unary,
    "swap": select_swap,
}
