"""Bitwise evaluation of expressions.

Each bit of a result is a constant, or a bit of a loaded value or its complement. The evaluation recognises the
single-bit changes among the forms that the front end gives to assignments of bit-fields.
"""

from __future__ import annotations

from toolchain.ir.model import ConstInt, Instr, Value

Bit = int | tuple[int, bool] | None
"""0, 1, (number of a bit of the loaded value, whether complemented), or None if it is none of these."""
OPERATIONS = frozenset(
    ("and", "or", "xor", "add", "sub", "shl", "lshr", "ashr", "zext", "sext", "trunc", "icmp", "select")
)


def single_change(value: Value, loads: list[Instr]) -> tuple[str, int] | None:
    """("and", "or" or "xor", constant) if `value` is the loaded value with one bit changed, else None.

    All loads count as one value."""
    known: dict[int, list[Bit]] = {id(load): [(k, False) for k in range(load.type.bits)] for load in loads}
    bits = _bits(value, known)
    changed = [k for k, bit in enumerate(bits) if bit != (k, False)]
    if len(changed) != 1:
        return None
    k = changed[0]
    ones = (1 << len(bits)) - 1
    if bits[k] == 0:
        return "and", ones & ~(1 << k)
    if bits[k] == 1:
        return "or", 1 << k
    return ("xor", 1 << k) if bits[k] == (k, True) else None


def _bits(v: Value, known: dict[int, list[Bit]]) -> list[Bit]:
    """Bits of a value, lowest first."""
    found = known.get(id(v))
    if found is not None:
        return found
    width = v.type.bits
    if isinstance(v, ConstInt):
        return [v.value >> k & 1 for k in range(width)]
    out: list[Bit] = [None] * width
    if isinstance(v, Instr):
        out = _operation(v, [_bits(a, known) for a in v.args], width)
    known[id(v)] = out
    return out


def _operation(i: Instr, args: list[list[Bit]], width: int) -> list[Bit]:
    """Bits of the result of one operation."""
    first, last = args[0], args[-1]
    match i.op:
        case "and" | "or" | "xor":
            return [_logical(i.op, a, b) for a, b in zip(first, last, strict=True)]
        case "add" | "sub":
            return _sum(first, last)
        case "shl" | "lshr" | "ashr":
            by = i.args[1]
            if not isinstance(by, ConstInt) or by.value >= width:
                return [None] * width
            if i.op == "shl":
                return ([0] * by.value + first)[:width]
            return first[by.value :] + [0 if i.op == "lshr" else first[-1]] * by.value
        case "zext" | "sext" | "trunc":
            fill: Bit = first[-1] if i.op == "sext" else 0
            return (first + [fill] * width)[:width]
        case "icmp":
            return [_comparison(str(i.extra.get("pred")), first, last)]
        case "select":
            return [_logical("or", _logical("and", first[0], a), _logical("and", complement(first[0]), b))
                    for a, b in zip(args[1], args[2], strict=True)]  # fmt: skip
    return [None] * width


def complement(bit: Bit) -> Bit:
    """The complement of a bit."""
    if isinstance(bit, tuple):
        return bit[0], not bit[1]
    return None if bit is None else 1 - bit


def _logical(op: str, a: Bit, b: Bit) -> Bit:
    """One bit of AND, OR or XOR."""
    if op == "xor":
        if a in (0, 1) or b in (0, 1):
            constant, other = (a, b) if a in (0, 1) else (b, a)
            return complement(other) if constant else other
        if a is None or b is None:
            return None
        return 0 if a == b else 1 if a == complement(b) else None
    absorbing = 0 if op == "and" else 1
    if a == absorbing or b == absorbing:
        return absorbing
    if a == 1 - absorbing:
        return b
    if b == 1 - absorbing or a == b:
        return a
    return absorbing if a is not None and a == complement(b) else None


def _sum(a: list[Bit], b: list[Bit]) -> list[Bit]:
    """Bits of a sum or difference: the lowest one is that of XOR, the others are unknown because of carry or borrow."""
    low = _logical("xor", a[0], b[0])
    return [low] + [None] * (len(a) - 1)


def _comparison(pred: str, a: list[Bit], b: list[Bit]) -> Bit:
    """The result of a comparison for equality in which one bit decides."""
    differ = [_logical("xor", x, y) for x, y in zip(a, b, strict=True)]
    if pred not in ("eq", "ne") or None in differ:
        return None
    deciding = {bit for bit in differ if bit != 0}
    if len(deciding) > 1:
        return None
    unequal = deciding.pop() if deciding else 0
    return unequal if pred == "ne" else complement(unequal)
