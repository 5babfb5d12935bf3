"""Lanes of a vector packed into one integer, first lane lowest, and unpacked again."""

from __future__ import annotations

from toolchain.ir.build import IrBuilder, const, legal_type
from toolchain.ir.model import Type, UnsupportedError, Value, int_type

MAX_PACKED_BITS = 128


def packed_type(t: Type) -> Type:
    """The integer type that holds a vector as argument, result or bitcast. Raises UnsupportedError if there is none."""
    bits = t.elems[0].bits * t.count
    if bits > MAX_PACKED_BITS:
        raise UnsupportedError(f"{t} as one value")
    return legal_type(int_type(bits))


def pack(b: IrBuilder, lanes: list[Value], t: Type) -> Value:
    """Build the integer that holds the lanes of a vector of type `t`."""
    return concatenate(b, lanes, t.elems[0].bits, packed_type(t))


def unpack(b: IrBuilder, whole: Value, t: Type) -> list[Value]:
    """Build the lanes of a vector of type `t` from the integer that holds them."""
    return [_lane(b, whole, k * t.elems[0].bits, t.elems[0]) for k in range(t.count)]


def regroup(b: IrBuilder, lanes: list[Value], old: Type, new: Type) -> list[Value]:
    """Build the lanes of vector type `new` from the same bits as the lanes of vector type `old`."""
    old_bits, new_bits = old.elems[0].bits, new.elems[0].bits
    if old_bits == new_bits:
        return lanes
    if old_bits % new_bits == 0:
        return [_lane(b, v, at, new.elems[0]) for v in lanes for at in range(0, old_bits, new_bits)]
    if new_bits % old_bits:
        return unpack(b, pack(b, lanes, old), new)
    step = new_bits // old_bits
    lane = legal_type(new.elems[0])
    return [concatenate(b, lanes[k : k + step], old_bits, lane) for k in range(0, len(lanes), step)]


def _lane(b: IrBuilder, whole: Value, at: int, t: Type) -> Value:
    """Build the value of type `t` whose lowest bit is bit `at` of an integer."""
    low = b.shift("lshr", whole, at)
    if t.bits == 1:
        return b.icmp("ne", b.binary("and", low, const(low.type, 1)), const(low.type, 0))
    return b.cast("trunc", low, legal_type(t))


def concatenate(b: IrBuilder, parts: list[Value], bits: int, t: Type) -> Value:
    """Build an integer of type `t` from parts of `bits` bits each."""
    whole: Value = const(t, 0)
    for k, part in enumerate(parts):
        wide = b.shift("shl", b.cast("zext", part, t), k * bits) if t.bits > part.type.bits else part
        whole = b.binary("or", whole, wide)
    return whole
