"""Selection of multiplication and division."""

from __future__ import annotations

from toolchain.ir.model import ConstInt, Instr, Value
from toolchain.mir.operands import Imm, Mem
from toolchain.select.context import Handler, SelectionContext
from toolchain.select.state import words_of


def _extension_kind(v: Value) -> tuple[str, Value] | None:
    """("s" or "u", narrow value) of an extension of at most 16 bits; None for other values."""
    if isinstance(v, Instr) and v.op in ("zext", "sext") and v.args[0].type.bits in (8, 16):
        return ("s" if v.op == "sext" else "u"), v.args[0]
    return None


def select_mul(s: SelectionContext, i: Instr) -> None:
    """Select a product: one MUL for words and for words extended to 32 bits, else a sum of partial products."""
    if words_of(i) == 1:
        _mul_word(s, i)
        return
    a, b = i.args
    ka, kb = _extension_kind(a), _extension_kind(b)
    if ka is not None and i.type.bits == 32 and (kb is not None or _fits(b, ka[0])):
        _mul_extended(s, i, ka, kb)
        return
    if i.type.bits == 32 and (signed := _signed_word(s, i)) is not None:
        _mul_signed(s, i, *signed)
        return
    _mul_wide(s, i, ka, kb)


def _signed_word(s: SelectionContext, i: Instr) -> tuple[Value, int] | None:
    """(factor of two words, register of the other factor) if the latter is a signed word or small negative constant."""
    for a, b in (i.args, i.args[::-1]):
        kind = _extension_kind(b)
        if kind is not None and kind[0] == "s":
            return a, _narrow_reg(s, *kind)
        if isinstance(b, ConstInt) and -0x8000 <= b.signed < 0:
            t = s.temp()
            s.load_imm(b.value & 0xFFFF, t)
            return a, t
    return None


def _mul_signed(s: SelectionContext, i: Instr, a: Value, b: int) -> None:
    """Emit (h * 2^16 + l) * b: the unsigned-by-signed product l * b, plus the low word of h * b in the upper word."""
    d = s.value_regs(i)
    words = s.regs(a)
    upper = s.m.new_pair()
    crossed = s.temp()
    s.emit("mul.ss", words[1], b, upper)
    s.emit("splitlo", crossed, upper)
    low, high = _pair(s, "us", words[0], b)
    s.copy(low, d[0])
    s.emit("add", high, crossed, d[1])


def _fits(b: Value, kind: str) -> bool:
    """Whether a value is a constant of 16 bits, unsigned or signed according to `kind`."""
    return isinstance(b, ConstInt) and (b.value <= 0xFFFF or (kind == "s" and -0x8000 <= b.signed < 0))


def _pair(s: SelectionContext, kind: str, a: int, b: int | Imm | Mem) -> tuple[int, int]:
    """Emit MUL.kind a, b; return new registers (low, high)."""
    p = s.m.new_pair()
    s.emit(f"mul.{kind}", a, b, p)
    low, high = s.temp(), s.temp()
    s.m.pair_hints[low] = high
    s.emit("split", low, high, p)
    return low, high


def _product(s: SelectionContext, kind: str, a: int, b: int | Imm | Mem, low: int, high: int) -> None:
    """Emit MUL.kind a, b with the result in (low, high)."""
    p = s.m.new_pair()
    s.emit(f"mul.{kind}", a, b, p)
    s.emit("split", low, high, p)


def _mul_word(s: SelectionContext, i: Instr) -> None:
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


def _narrow_reg(s: SelectionContext, kind: str, v: Value) -> int:
    """Register with the narrow value of an extension; bytes are extended to words."""
    if v.type.bits == 16:
        return s.reg(v)
    r = s.temp()
    s.emit("se" if kind == "s" else "ze", s.reg(v), r)
    return r


def _extended_load(s: SelectionContext, v: Value, i: Instr) -> Instr | None:
    """The load of an extended word that can be folded into the product and has no other user; else None."""
    if not isinstance(v, Instr) or not s.single_use(v) or id(v) in s.register_values or v.args[0].type.bits != 16:
        return None
    return s.foldable_load(v.args[0], i)


def _mul_extended(s: SelectionContext, i: Instr, ka: tuple[str, Value], kb: tuple[str, Value] | None) -> None:
    low, high = s.value_regs(i)
    a, b = i.args
    if kb is not None:
        if _extended_load(s, a, i) is not None and _extended_load(s, b, i) is None:
            a, b, ka, kb = b, a, kb, ka
        load = _extended_load(s, b, i)
        right = s.source(load, i) if load is not None else _narrow_reg(s, *kb)
        assert isinstance(right, int | Mem)
        _product(s, ka[0] + kb[0], _narrow_reg(s, *ka), right, low, high)
        return
    x = _narrow_reg(s, *ka)
    assert isinstance(b, ConstInt)
    if b.value <= 31:
        _product(s, ka[0] + "u", x, Imm(b.value), low, high)
        return
    t = s.temp()
    s.load_imm(b.value & 0xFFFF, t)
    _product(s, ka[0] + ("u" if b.value <= 0xFFFF else "s"), x, t, low, high)


def _mul_wide(s: SelectionContext, i: Instr, ka: tuple[str, Value] | None, kb: tuple[str, Value] | None) -> None:
    """Emit the product modulo 2^bits as a sum of partial products; words known to be zero are skipped."""
    n = words_of(i)
    a, b = s.regs(i.args[0]), s.regs(i.args[1])
    d = s.value_regs(i)
    zero_a, zero_b = _zero_words(i.args[0], ka), _zero_words(i.args[1], kb)
    total: list[int | None] = [None] * n
    # For two words, the upper one is first, so that the last product can remain in its registers.
    for k in range(n) if n > 2 else (1, 0):
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
        return {k for k in range(words_of(v)) if not v.value >> 16 * k & 0xFFFF}
    if isinstance(v, Instr) and v.op == "zext":
        return set(range(max(1, v.args[0].type.bits // 16), words_of(v)))
    return set()


def _accumulate(s: SelectionContext, total: list[int | None], k: int, low: int, high: int | None) -> None:
    """Emit total += (high:low) << 16k; the carry propagates to the top word."""
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


def select_mulhigh(s: SelectionContext, i: Instr) -> None:
    """Select the upper two words of the product of two words and an unsigned constant of two words.

    x * y + z fits in two words for words x, y, z, so the first carry propagates one word only. MUL changes no flags."""
    (low, high), d = s.regs(i.args[0]), s.value_regs(i)
    m, kind = i.args[1], "su" if i.extra["signed"] else "uu"
    assert isinstance(m, ConstInt)
    m_low, m_high = s.temp(), s.temp()
    s.load_imm(m.value & 0xFFFF, m_low)
    s.load_imm(m.value >> 16, m_high)
    _, outer = _pair(s, "uu", low, m_low)
    one_low, one_high = _pair(s, "uu", low, m_high)
    sums = [s.temp() for _ in range(5)]
    s.emit("add", one_low, outer, sums[0])
    s.emit("addc", one_high, Imm(0), sums[1])
    other_low, other_high = _pair(s, kind, high, m_low)
    sign: int | Imm = Imm(0)
    if i.extra["signed"]:
        sign = s.temp()
        s.emit("asr", other_high, Imm(15), sign)
    s.emit("add", other_low, sums[0], sums[2])
    s.emit("addc", other_high, sums[1], sums[3])
    top_low, top_high = _pair(s, kind, high, m_high)
    s.emit("addc", top_high, sign, sums[4])
    s.emit("add", top_low, sums[3], d[0])
    s.emit("addc", sums[4], Imm(0), d[1])


def select_divide(s: SelectionContext, i: Instr) -> None:
    """Select a 16-bit DIV under REPEAT #17: quotient in W0, remainder in W1 (isa.md §6.7), never the divisor."""
    signed = i.op in ("sdiv", "srem")
    m, n = s.reg(i.args[0]), s.reg(i.args[1])
    mi = s.emit("div.s" if signed else "div.u", m, n)
    mi.also_defs = (0, 1)
    mi.late = (1,)
    quotient = i.op in ("sdiv", "udiv")
    other = i.extra.get("other")
    if isinstance(other, Instr) and id(other) in s.needed:
        s.copy(1 if quotient else 0, s.value_regs(other)[0])
    if id(i) in s.register_values:
        s.copy(0 if quotient else 1, s.result(i))


def select_divother(s: SelectionContext, i: Instr) -> None:
    """Emit no code: the division copies its second result to the register."""
    s.value_regs(i)
    s.needed.add(id(i.args[0]))


HANDLERS: dict[str, Handler] = {
    "mul": select_mul,
    "mulhigh": select_mulhigh,
    **dict.fromkeys(("udiv", "sdiv", "urem", "srem"), select_divide),
    "divother": select_divother,
}
