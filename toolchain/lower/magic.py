"""Division by constants as multiplication: x / d is the high word of x * m, shifted (Granlund, Montgomery 1994).

MUL takes a cycle where REPEAT DIV takes 19 (isa.md §6.7). Needs: legal IR, 16 bits. Used where speed counts.
"""

from __future__ import annotations

from ..ir.model import I16, I32, Block, ConstInt, Function, Instr, Value
from .build import Builder, const

WORD = 1 << 16


def run(f: Function) -> None:
    """Rewrite quotients and remainders of every block; those of the same operands share the quotient."""
    for b in f.blocks:
        scratch = Block(b.name)
        quotients: dict[tuple[str, int, int], Value] = {}
        for i in b.instrs:
            if _wanted(i):
                _rewrite(scratch, i, quotients)
            scratch.instrs.append(i)
        b.instrs = scratch.instrs


def _wanted(i: Instr) -> bool:
    if i.op not in ("udiv", "sdiv", "urem", "srem") or i.type is not I16 or "other" in i.extra:
        return False
    d = i.args[1]
    if not isinstance(d, ConstInt) or isinstance(i.args[0], ConstInt):
        return False
    return d.value > 2 and d.value & (d.value - 1) != 0 and d.value < (WORD >> 1)


def _rewrite(block: Block, i: Instr, quotients: dict[tuple[str, int, int], Value]) -> None:
    """Put what comes before `i` into the block and make `i` the last step."""
    x, d = i.args
    assert isinstance(d, ConstInt)
    b = Builder(block)
    b.line = i.line
    key = (i.op[0], id(x), d.value)
    quotient = quotients.get(key)
    if quotient is None:
        quotient = _signed(b, x, d.value) if i.op[0] == "s" else _unsigned(b, x, d.value)
        quotients[key] = quotient
    remainder = i.op.endswith("rem")
    i.extra = {}
    i.op = "sub" if remainder else "add"
    i.args = [x, b.binary("mul", quotient, d)] if remainder else [quotient, const(I16, 0)]


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
    m, s = signed_factor(d)
    high = _high(b, x, m, "sext")
    if m >= WORD >> 1:
        high = b.binary("add", high, x)
    return b.binary("add", b.shift("ashr", high, s), b.shift("lshr", x, 15))
