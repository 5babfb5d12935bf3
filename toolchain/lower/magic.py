"""Division by constants as multiplication: x / d is the high word of x * m, shifted (Granlund, Montgomery 1994).

MUL takes a cycle where REPEAT DIV takes 19 (isa.md §6.7). Signed division by 2^k is a shift of x, made 2^k - 1 larger
where it is negative. Needs: legal IR, 16 bits. For size only where the product takes no more words than DIV.
"""

from __future__ import annotations

from ..ir.model import I16, I32, Block, ConstInt, Function, Instr, Value
from .build import Builder, const

WORD = 1 << 16


def run(f: Function, for_size: bool) -> None:
    """Rewrite quotients and remainders of every block; those of the same operands share the quotient."""
    for b in f.blocks:
        wanted = [i for i in b.instrs if _wanted(i)]
        if for_size:
            wanted = [i for i in wanted if _short(i, wanted)]
        scratch = Block(b.name)
        quotients: dict[tuple[str, int, int], Value] = {}
        for i in b.instrs:
            if i in wanted:
                _rewrite(scratch, i, quotients)
            scratch.instrs.append(i)
        b.instrs = scratch.instrs


def _wanted(i: Instr) -> bool:
    if i.op not in ("udiv", "sdiv", "urem", "srem") or i.type is not I16 or "other" in i.extra:
        return False
    d = i.args[1]
    if not isinstance(d, ConstInt) or isinstance(i.args[0], ConstInt):
        return False
    if i.op[0] == "s":
        return 2 <= abs(d.signed) < WORD >> 1
    return d.value > 2 and d.value & (d.value - 1) != 0 and d.value < (WORD >> 1)


def _short(i: Instr, others: list[Instr]) -> bool:
    """MOV, MUL, LSR instead of MOV, REPEAT, DIV, unless that DIV gives a remainder too."""
    d = i.args[1]
    assert isinstance(d, ConstInt)
    if i.op != "udiv" or unsigned_factor(d.value)[0] >= WORD:
        return False
    same = [o for o in others if o.op == "urem" and o.args[0] is i.args[0]]
    return not any(isinstance(o.args[1], ConstInt) and o.args[1].value == d.value for o in same)


def _rewrite(block: Block, i: Instr, quotients: dict[tuple[str, int, int], Value]) -> None:
    """Put what comes before `i` into the block and make `i` the last step."""
    x, d = i.args
    assert isinstance(d, ConstInt)
    b = Builder(block)
    b.line = i.line
    key = (i.op[0], id(x), d.value)
    quotient = quotients.get(key)
    if quotient is None:
        quotient = _signed(b, x, d.signed) if i.op[0] == "s" else _unsigned(b, x, d.value)
        quotients[key] = quotient
    remainder = i.op.endswith("rem")
    i.extra = {}
    i.op = "sub" if remainder else "bits"
    i.args = [x, b.binary("mul", quotient, d)] if remainder else [quotient]


def unsigned_factor(d: int) -> tuple[int, int]:
    """(m, s) with x // d == x * m >> 16 + s for all x of 16 bits; m has at most 17 bits."""
    for s in range(17):
        m = (WORD << s) // d + 1
        if (m * d - (WORD << s)) * (WORD - 1) < WORD << s:
            return m, s
    raise AssertionError(d)


def signed_factor(d: int) -> tuple[int, int]:
    """(m, s) with x / d == (x * m >> 16 + s) + (x < 0), towards 0, for all signed x of 16 bits."""
    for s in range(16):
        m = (WORD << s) // d + 1
        if (m * d - (WORD << s)) * (WORD >> 1) < WORD << s:
            return m, s
    raise AssertionError(d)


def _high(b: Builder, x: Value, m: int, extend: str) -> Value:
    """Upper word of x * m."""
    product = b.binary("mul", b.cast(extend, x, I32), b.cast(extend, const(I16, m), I32))
    return b.cast("trunc", b.shift("lshr", product, 16), I16)


def _unsigned(b: Builder, x: Value, d: int) -> Value:
    m, s = unsigned_factor(d)
    if m < WORD:
        return b.shift("lshr", _high(b, x, m, "zext"), s)
    high = _high(b, x, m - WORD, "zext")  # (x + high) >> s without the 17th bit
    half = b.shift("lshr", b.binary("sub", x, high), 1)
    return b.shift("lshr", b.binary("add", half, high), s - 1)


def _signed(b: Builder, x: Value, d: int) -> Value:
    if d < 0:
        return b.binary("sub", const(I16, 0), _signed(b, x, -d))
    if d & (d - 1) == 0:
        k = d.bit_length() - 1
        sign = b.shift("ashr", x, 15) if k > 1 else x
        return b.shift("ashr", b.binary("add", x, b.shift("lshr", sign, 16 - k)), k)
    m, s = signed_factor(d)
    high = _high(b, x, m, "sext")
    if m >= WORD >> 1:
        high = b.binary("add", high, x)
    return b.binary("add", b.shift("ashr", high, s), b.shift("lshr", x, 15))
