"""Selection of arithmetic, logic, shifts, multiplication, division and width changes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from ..ir.model import I1, ConstInt, Instr, Value
from .mir import MI, Imm, Mem, OpInfo
from .rules import CARRY_OP, COMMUTES, REGISTER_OP, ImmRule, immediate_rule

if TYPE_CHECKING:
    from .select import Selector


def _words(v: Value) -> int:
    return max(1, v.type.bits // 16)


# ---------------------------------------------------------------------------------------------------------------------
# add sub and or xor


def select_binary(s: Selector, i: Instr) -> None:
    """One word: rule table, then register form with a folded load. Several words: a carry chain."""
    if _words(i) > 1:
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


def _file_logic(s: Selector, i: Instr, a: Value, b: ConstInt, d: int, byte: bool) -> bool:
    """near object op constant, through W0: one word less than loading both (abi-elf.md §8.1, bit-field writes)."""
    if i.op not in ("and", "or", "xor") or immediate_rule(i.op, b.value, i.type.bits) is not None:
        return False
    near = s.near_operand(a, i)
    if near is None:
        return False
    s.load_imm(b.value, 0)
    s.emit(REGISTER_OP[i.op] + "w", near, 0, byte=byte).volatile = True
    s.copy(0, d)
    return True


def _reverse_subtract(s: Selector, i: Instr, a: ConstInt, d: int, byte: bool) -> None:
    """constant - b."""
    right = s.source(i.args[1], i)
    if a.value == 0:
        s.emit("neg", right, d, byte=byte)
    elif a.value <= 31 and isinstance(right, int):
        s.emit("subr", right, Imm(a.value), d, byte=byte)
    elif a.value == (1 << i.type.bits) - 1:
        s.emit("com", right, d, byte=byte)
    else:
        s.emit("sub", s.reg(a), right, d, byte=byte)


def apply_immediate(s: Selector, op: str, a: Value, k: int, d: int, byte: bool, user: Instr | None) -> None:
    """d = a op k by the first fitting rule; the constant goes to a register otherwise."""
    rule = immediate_rule(op, k, 8 if byte else 16)
    if rule is not None and rule.form == "unary" and user is not None and rule.op != "ze":
        s.emit(rule.op, s.source(a, user), d, byte=byte)
        return
    apply_rule(s, rule, op, s.reg(a), k, d, byte)


def apply_rule(s: Selector, rule: ImmRule | None, op: str, a: int, k: int, d: int, byte: bool) -> None:
    """d = a op k for a register a."""
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


def _wide_binary(s: Selector, i: Instr) -> None:
    """Word by word; add and sub carry. Constant words use literals; words that change nothing are copies."""
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
    for k, (x, y, r) in enumerate(zip(left, right, d, strict=True)):
        if k in known or k in known_a:
            if i.op == "and":
                s.emit("clr", r)
            else:
                s.copy(x if k in known else y, r)
            continue
        s.emit(REGISTER_OP[i.op] if k == 0 else CARRY_OP[i.op], x, y, r)


def _known_zero_words(v: Value) -> set[int]:
    """Words of a value that are certainly 0: the upper part of a zext, the lower part of a shift by whole words."""
    if isinstance(v, Instr):
        if v.op == "zext":
            return set(range(_words(v.args[0]), _words(v)))
        if v.op == "shl" and isinstance(v.args[1], ConstInt):
            inner = _known_zero_words(v.args[0])
            n = v.args[1].value // 16
            lost = {k + n for k in inner} if v.args[1].value % 16 == 0 else set()
            return {k for k in set(range(n)) | lost if k < _words(v)}
    return set()


def _wide_reverse(s: Selector, i: Instr, a: ConstInt) -> None:
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


def _wide_immediate(s: Selector, op: str, a: tuple[int, ...], value: int, d: tuple[int, ...]) -> None:
    """Wide operation with a constant."""
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


def _wide_add_immediate(s: Selector, op: str, a: tuple[int, ...], words: list[int], d: tuple[int, ...]) -> None:
    """Add or subtract a constant, choosing the direction with more short literals; leading zero words are copies."""
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


# ---------------------------------------------------------------------------------------------------------------------
# shifts


def select_shift(s: Selector, i: Instr) -> None:
    """shl lshr ashr by constants or variables, any width."""
    a, n = i.args
    if isinstance(n, ConstInt):
        if _words(i) == 1:
            _shift_word(s, i, n.value)
        else:
            _shift_wide_constant(s, i.op, s.regs(a), n.value, s.value_regs(i))
    elif _words(i) == 1:
        _shift_word_variable(s, i)
    else:
        _shift_wide_variable(s, i)


SHIFT_OP = {"shl": "sl", "lshr": "lsr", "ashr": "asr"}


def _extended_byte(s: Selector, v: Value, signed: bool, user: Instr) -> int:
    """A byte value extended to a word."""
    r = s.temp()
    s.emit("se" if signed else "ze", s.source(v, user), r)
    return r


def _shift_word(s: Selector, i: Instr, n: int) -> None:
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


def _shift_word_variable(s: Selector, i: Instr) -> None:
    """Native for words; the count uses its low 5 bits, counts of 16 and more are undefined in the IR."""
    d, byte = s.result(i), i.type.bits == 8
    a = _extended_byte(s, i.args[0], i.op == "ashr", i) if byte and i.op != "shl" else s.reg(i.args[0])
    s.emit(SHIFT_OP[i.op], a, s.reg(i.args[1]), d)


def _shift_wide_constant(s: Selector, op: str, a: tuple[int, ...], n: int, d: tuple[int, ...]) -> None:
    """Whole words move; the rest is shifted with neighbours' bits brought in."""
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
                _fill(s, op, a[top], d[k])
            elif k + jump == top:
                s.emit(SHIFT_OP[op], a[top], Imm(bits), d[k])
            else:
                _combine(s, "lsr", a[k + jump], bits, "sl", a[k + jump + 1], d[k])


def _combine(s: Selector, op: str, main: int, bits: int, other_op: str, other: int, d: int) -> None:
    """d = main shifted by bits | neighbour shifted the other way."""
    x, y = s.temp(), s.temp()
    s.emit(op, main, Imm(bits), x)
    s.emit(other_op, other, Imm(16 - bits), y)
    s.emit("ior", x, y, d)


def _fill(s: Selector, op: str, top: int, d: int) -> None:
    """Word above the value: zero or sign."""
    if op == "ashr":
        s.emit("asr", top, Imm(15), d)
    else:
        s.emit("clr", d)


def _move_words(s: Selector, op: str, a: tuple[int, ...], jump: int, d: tuple[int, ...]) -> None:
    count = len(a)
    for k in range(count):
        source = k - jump if op == "shl" else k + jump
        if 0 <= source < count:
            s.copy(a[source], d[k])
        elif op == "shl":
            s.emit("clr", d[k])
        else:
            _fill(s, op, a[count - 1], d[k])


def _shift_by_one(s: Selector, op: str, a: tuple[int, ...], d: tuple[int, ...]) -> None:
    """Through the carry: SL/RLC upward, LSR or ASR/RRC downward (abi-elf.md §8.1)."""
    if op == "shl":
        for k in range(len(a)):
            s.emit("sl1" if k == 0 else "rlc", a[k], d[k])
        return
    top = len(a) - 1
    for k in range(top, -1, -1):
        s.emit(("asr1" if op == "ashr" else "lsr1") if k == top else "rrc", a[k], d[k])


def _shift_wide_variable(s: Selector, i: Instr) -> None:
    """A loop of one-bit shifts on copies (abi-elf.md §8.1: 5 words for 32 bits)."""
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


# ---------------------------------------------------------------------------------------------------------------------
# multiplication and division


def _extension_kind(v: Value) -> tuple[str, Value] | None:
    """("s" or "u", narrow value) when a wide value is an extension of at most 16 bits, or a small constant."""
    if isinstance(v, Instr) and v.op in ("zext", "sext") and v.args[0].type.bits in (8, 16):
        return ("s" if v.op == "sext" else "u"), v.args[0]
    return None


def select_mul(s: Selector, i: Instr) -> None:
    """One word: low half of a product. 32 bits of two extended words: one MUL. Else sums of partial products."""
    if _words(i) == 1:
        _mul_word(s, i)
        return
    a, b = i.args
    ka, kb = _extension_kind(a), _extension_kind(b)
    if ka is not None and i.type.bits == 32 and (kb is not None or isinstance(b, ConstInt)):
        if kb is not None or _fits(b, ka[0]):
            _mul_extended(s, i, ka, kb)
            return
    _mul_wide(s, i, ka, kb)


def _fits(b: Value, kind: str) -> bool:
    return isinstance(b, ConstInt) and (b.value <= 0xFFFF or (kind == "s" and -0x8000 <= b.signed < 0))


def _pair(s: Selector, kind: str, a: int, b: int | Imm | Mem) -> tuple[int, int]:
    """MUL.kind a, b -> fresh (low, high) registers."""
    p = s.m.new_pair()
    s.emit(f"mul.{kind}", a, b, p)
    low, high = s.temp(), s.temp()
    s.m.pair_hints[low] = high
    s.emit("split", low, high, p)
    return low, high


def _product(s: Selector, kind: str, a: int, b: int | Imm | Mem, low: int, high: int) -> None:
    p = s.m.new_pair()
    s.emit(f"mul.{kind}", a, b, p)
    s.emit("split", low, high, p)


def _mul_word(s: Selector, i: Instr) -> None:
    a, b = i.args
    right: int | Imm | Mem
    if isinstance(b, ConstInt):
        right = Imm(b.value) if b.value <= 31 else s.reg(b)
    else:
        if i.type.bits == 16:
            operand = s.source(b, i)
            assert isinstance(operand, int | Mem)
            right = operand
        else:
            right = s.reg(b)
    kind = "su" if isinstance(right, Imm) else "ss"
    p = s.m.new_pair()
    s.emit(f"mul.{kind}", s.reg(a), right, p)
    s.emit("splitlo", s.result(i), p)


def _narrow_reg(s: Selector, kind: str, v: Value) -> int:
    """The 16-bit register of an extended value; bytes are extended first."""
    if v.type.bits == 16:
        return s.reg(v)
    r = s.temp()
    s.emit("se" if kind == "s" else "ze", s.reg(v), r)
    return r


def _mul_extended(s: Selector, i: Instr, ka: tuple[str, Value], kb: tuple[str, Value] | None) -> None:
    low, high = s.value_regs(i)
    x = _narrow_reg(s, *ka)
    if kb is not None:
        _product(s, ka[0] + kb[0], x, _narrow_reg(s, *kb), low, high)
        return
    b = i.args[1]
    assert isinstance(b, ConstInt)
    if b.value <= 31:
        _product(s, ka[0] + "u", x, Imm(b.value), low, high)
        return
    t = s.temp()
    s.load_imm(b.value & 0xFFFF, t)
    _product(s, ka[0] + ("u" if b.value <= 0xFFFF else "s"), x, t, low, high)


def _mul_wide(s: Selector, i: Instr, ka: tuple[str, Value] | None, kb: tuple[str, Value] | None) -> None:
    """Schoolbook product modulo 2^bits. Words known to be zero are skipped."""
    n = _words(i)
    a, b = s.regs(i.args[0]), s.regs(i.args[1])
    d = s.value_regs(i)
    zero_a, zero_b = _zero_words(i.args[0], ka), _zero_words(i.args[1], kb)
    total: list[int | None] = [None] * n
    for k in range(n):
        for j in range(k + 1):
            if j in zero_a or k - j in zero_b:
                continue
            if k + 1 < n:
                low, high = _pair(s, "uu", a[j], b[k - j])
                _accumulate(s, total, k, low, high)
            else:
                p, low = s.m.new_pair(), s.temp()
                s.emit("mul.ss", a[j], b[k - j], p)
                s.emit("splitlo", low, p)
                _accumulate(s, total, k, low, None)
    for r, t in zip(d, total, strict=True):
        if t is None:
            s.emit("clr", r)
        else:
            s.copy(t, r)


def _zero_words(v: Value, kind: tuple[str, Value] | None) -> set[int]:
    if isinstance(v, ConstInt):
        return {k for k in range(_words(v)) if not v.value >> 16 * k & 0xFFFF}
    if isinstance(v, Instr) and v.op == "zext":
        return set(range(max(1, v.args[0].type.bits // 16), _words(v)))
    return set()


def _accumulate(s: Selector, total: list[int | None], k: int, low: int, high: int | None) -> None:
    """total += (high:low) << 16k, with the carry running to the top."""
    parts = [low] if high is None else [low, high]
    carry = False
    for j, part in enumerate(parts):
        at = k + j
        if at >= len(total):
            return
        old = total[at]
        if old is None and not carry:
            total[at] = part
            continue
        r = s.temp()
        if old is None:
            s.emit("addc", part, Imm(0), r)
        else:
            s.emit("addc" if carry else "add", old, part, r)
        total[at] = r
        carry = True
    at = k + len(parts)
    while carry and at < len(total):
        old = total[at]
        r = s.temp()
        if old is None:
            zero = s.temp()
            s.emit("clr", zero)
            s.emit("addc", zero, Imm(0), r)
        else:
            s.emit("addc", old, Imm(0), r)
        total[at] = r
        at += 1


def select_divide(s: Selector, i: Instr) -> None:
    """16-bit DIV under REPEAT #17: quotient in W0, remainder in W1 (isa.md §6.7). The divisor must survive them."""
    signed = i.op in ("sdiv", "srem")
    m, n = s.reg(i.args[0]), s.reg(i.args[1])
    mi = s.emit("div.s" if signed else "div.u", m, n)
    mi.also_defs = (0, 1)
    mi.late = (1,)
    quotient = i.op in ("sdiv", "udiv")
    other = i.extra.get("other")
    if isinstance(other, Instr) and id(other) in s.needed:
        s.copy(1 if quotient else 0, s.value_regs(other)[0])
    if id(i) in s.wanted:
        s.copy(0 if quotient else 1, s.result(i))


def select_divother(s: Selector, i: Instr) -> None:
    """The second result of a division: the division itself copies it out."""
    s.value_regs(i)
    s.needed.add(id(i.args[0]))


# ---------------------------------------------------------------------------------------------------------------------
# width changes and single-word helpers


def select_extend(s: Selector, i: Instr) -> None:
    """zext and sext. Words of the source are shared, not copied."""
    v, signed = i.args[0], i.op == "sext"
    d = s.value_regs(i)
    if s.is_leaf(v):
        for k, r in enumerate(d):
            if k < _words(v):
                s.load_leaf(v, k, r)
            else:
                _fill(s, "ashr" if signed else "lshr", d[_words(v) - 1], r)
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
        low = _words(v)
    for k in range(low, len(d)):
        if signed and k > low:
            s.copy(d[low], d[k])
        else:
            _fill(s, "ashr" if signed else "lshr", d[low - 1], d[k])


def _byte_source(s: Selector, v: Value, i: Instr) -> int | Mem:
    operand = s.source(v, i)
    assert isinstance(operand, int | Mem)
    return operand


def select_unary(s: Selector, i: Instr) -> None:
    """ff1l, ff1r."""
    s.emit(i.op, s.source(i.args[0], i), s.result(i))


def select_swap(s: Selector, i: Instr) -> None:
    """SWAP works in place."""
    d = s.result(i)
    s.copy(s.reg(i.args[0]), d)
    s.emit("swap", d)


SELECT: dict[str, Callable[[Selector, Instr], None]] = {
    **dict.fromkeys(("add", "sub", "and", "or", "xor"), select_binary),
    **dict.fromkeys(("shl", "lshr", "ashr"), select_shift),
    "mul": select_mul,
    **dict.fromkeys(("udiv", "sdiv", "urem", "srem"), select_divide),
    "divother": select_divother,
    "zext": select_extend,
    "sext": select_extend,
    "ff1l": select_unary,
    "ff1r": select_unary,
    "swap": select_swap,
}
