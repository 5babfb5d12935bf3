"""Division by constants as multiplication: x / d is the high word of x * m, shifted (Granlund, Montgomery 1994).

MUL takes one cycle, REPEAT DIV takes 19 (isa.md §6.7). Signed division by 2^k is a shift of x, plus 2^k - 1 if x is
negative. For size, the rewrite applies only if it takes no more words than DIV. Divisions of 32 bits are rewritten for
speed only: they take 17 words and cycles; a library call takes 3 words and 50 cycles. Needs: legal IR.
"""

from __future__ import annotations

from toolchain.ir.build import IrBuilder, const
from toolchain.ir.model import I16, I32, Block, ConstInt, Function, Instr, Value

OPERATIONS = frozenset(("udiv", "sdiv", "urem", "srem"))
REMAINDER = {"udiv": "urem", "sdiv": "srem"}


def run(f: Function, for_size: bool, for_speed: bool = False) -> None:
    """Rewrite quotients and remainders in every block; those of the same operands share the quotient."""
    for b in f.blocks:
        if for_speed:
            for i in b.instrs:
                _inline(i)
        wanted = [i for i in b.instrs if _is_candidate(i)]
        if for_size:
            wanted = [i for i in wanted if _saves_words(i, wanted)]
        scratch = Block(b.name)
        quotients: dict[tuple[str, int, int], Value] = {}
        for i in b.instrs:
            if i in wanted:
                _rewrite(scratch, i, quotients)
            scratch.instrs.append(i)
        b.instrs = scratch.instrs


def _inline(i: Instr) -> None:
    """Restore a 32-bit division by a constant from the library call into which legalisation turned it."""
    op = i.extra.get("divides")
    if isinstance(op, str) and i.type is I32 and _is_divisor(op, i.args[0], i.args[1]):
        i.op, i.args, i.extra = op, i.args[:2], {}


def _is_candidate(i: Instr) -> bool:
    """Whether an instruction is a division that can be rewritten."""
    if i.op not in OPERATIONS or (i.type is not I16 and i.type is not I32) or "other" in i.extra:
        return False
    return _is_divisor(i.op, i.args[0], i.args[1])


def _is_divisor(op: str, x: Value, d: Value) -> bool:
    """Whether a quotient or remainder by `d` can be computed by a multiplication."""
    if not isinstance(d, ConstInt) or isinstance(x, ConstInt) or d.type.bits not in (16, 32):
        return False
    least = 1 << d.type.bits - 1
    if op[0] == "s":
        return 2 <= abs(d.signed) < least
    return d.value > 2 and d.value & (d.value - 1) != 0 and d.value < least


def _saves_words(i: Instr, others: list[Instr]) -> bool:
    """Whether the rewrite takes no more words than MOV, REPEAT and DIV, and no remainder uses the same DIV."""
    d = i.args[1]
    assert isinstance(d, ConstInt)
    halved = i.op == "sdiv" and d.value == 2
    if not halved and (i.op != "udiv" or unsigned_factor(d.value)[0] >= 1 << 16):
        return False
    same = [o for o in others if o.op == REMAINDER[i.op] and o.args[0] is i.args[0]]
    return not any(isinstance(o.args[1], ConstInt) and o.args[1].value == d.value for o in same)


def _rewrite(block: Block, i: Instr, quotients: dict[tuple[str, int, int], Value]) -> None:
    """Append all steps of the computation except the last to the block, and turn `i` into the last one."""
    x, d = i.args
    assert isinstance(d, ConstInt)
    b = IrBuilder(block)
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


def unsigned_factor(d: int, bits: int = 16) -> tuple[int, int]:
    """(m, s) with x // d == x * m >> bits + s for all x of `bits` bits; m has at most bits + 1 bits."""
    word = 1 << bits
    for s in range(bits + 1):
        m = (word << s) // d + 1
        if (m * d - (word << s)) * (word - 1) < word << s:
            return m, s
    raise AssertionError(d)


def signed_factor(d: int, bits: int = 16) -> tuple[int, int]:
    """(m, s) with x / d == (x * m >> bits + s) + (x < 0), towards 0, for all signed x; m has at most `bits` bits."""
    word = 1 << bits
    for s in range(bits):
        m = (word << s) // d + 1
        if (m * d - (word << s)) * (word >> 1) < word << s:
            return m, s
    raise AssertionError(d)


def _high(b: IrBuilder, x: Value, m: int, extend: str) -> Value:
    """Upper half of x * m for 0 <= m < 2^bits, x extended by `extend`."""
    if x.type is I32:
        return b.emit("mulhigh", I32, [x, const(I32, m)], signed=extend == "sext")
    product = b.binary("mul", b.cast(extend, x, I32), b.cast(extend, const(I16, m), I32))
    high = b.cast("trunc", b.shift("lshr", product, 16), I16)
    return b.binary("add", high, x) if extend == "sext" and m >= 1 << 15 else high


def _unsigned(b: IrBuilder, x: Value, d: int) -> Value:
    bits = x.type.bits
    m, s = unsigned_factor(d, bits)
    if m < 1 << bits:
        return b.shift("lshr", _high(b, x, m, "zext"), s)
    high = _high(b, x, m - (1 << bits), "zext")  # (x + high) >> s without the carry out of x + high
    half = b.shift("lshr", b.binary("sub", x, high), 1)
    return b.shift("lshr", b.binary("add", half, high), s - 1)


def _signed(b: IrBuilder, x: Value, d: int) -> Value:
    bits = x.type.bits
    if d < 0:
        return b.binary("sub", const(x.type, 0), _signed(b, x, -d))
    if d & (d - 1) == 0:
        k = d.bit_length() - 1
        sign = b.shift("ashr", x, bits - 1) if k > 1 else x
        return b.shift("ashr", b.binary("add", x, b.shift("lshr", sign, bits - k)), k)
    m, s = signed_factor(d, bits)
    high = _high(b, x, m, "sext")
    return b.binary("add", b.shift("ashr", high, s), b.shift("lshr", x, bits - 1))
