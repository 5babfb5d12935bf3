"""Vectors of GNU C, lane by lane: a vector value is the list of its lanes, like any first-class aggregate.

An operation on vectors becomes one scalar instruction per lane, translated by the ordinary handlers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolchain.abi.target import ARGUMENT_REGISTERS
from toolchain.ir.build import const, legal_type
from toolchain.ir.model import VOID, ConstInt, Instr, Type, Undef, UnsupportedError, Value, int_type, size_of
from toolchain.legalize.lanes import Lane

if TYPE_CHECKING:
    from toolchain.legalize.base import LegalizerBase
    from toolchain.legalize.legalize import Legalizer

OWN = frozenset(
    ("extractelement", "insertelement", "shufflevector", "bitcast", "load", "store", "freeze", "call", "ret")
)


def lane_count(i: Instr) -> int:
    """Lanes of a vector operation handled here; 0 for everything else."""
    if i.op in OWN:
        return 0
    for v in (i, *i.args):
        if v.type.kind == "vector":
            return v.type.count
    return 0


def expand(lz: Legalizer, i: Instr, lanes: int) -> list[Value]:
    """One scalar instruction per lane."""
    out: list[Value] = []
    for k in range(lanes):
        t = i.type.elems[0] if i.type.kind == "vector" else i.type
        args = [Lane(a, k) if a.type.kind == "vector" else a for a in i.args]
        scalar = Instr(i.op, t, args)
        scalar.blocks, scalar.extra, scalar.line = list(i.blocks), i.extra, i.line
        lz.alive.append(scalar)
        lz.alive.append(args)
        value = lz.translate(scalar)
        assert isinstance(value, Value)
        out.append(value)
    return out


def intrinsic(lz: Legalizer, i: Instr) -> list[Value]:
    """A lane-wise intrinsic call: the callee's name decides by its first word only, so it serves for the lanes too."""
    out: list[Value] = []
    for k in range(i.type.count):
        args = [Lane(a, k) if a.type.kind == "vector" else a for a in i.args]
        scalar = Instr("call", i.type.elems[0], args)
        scalar.extra, scalar.line = i.extra, i.line
        lz.alive.append(args)
        value = lz.call(scalar)
        if not isinstance(value, Value):
            raise UnsupportedError(f"vector operand of {i.args[-1]!r}")
        out.append(value)
    return out


def extractelement(lz: Legalizer, i: Instr) -> Value:
    """A constant index picks; a variable one selects lane by lane."""
    lanes, index = lz.fields(i.args[0]), i.args[1]
    if isinstance(index, ConstInt):
        return lanes[index.value] if index.value < len(lanes) else Undef(legal_type(i.type))
    at = lz.zero_extended(index)
    result = lanes[0]
    for k in range(1, len(lanes)):
        result = lz.b.select(lz.b.icmp("eq", at, const(at.type, k)), lanes[k], result)
    return result


def insertelement(lz: Legalizer, i: Instr) -> list[Value]:
    """The vector with one lane replaced."""
    lanes, new, index = list(lz.fields(i.args[0])), lz.use(i.args[1]), i.args[2]
    if isinstance(index, ConstInt):
        if index.value < len(lanes):
            lanes[index.value] = new
        return lanes
    at = lz.zero_extended(index)
    return [lz.b.select(lz.b.icmp("eq", at, const(at.type, k)), new, old) for k, old in enumerate(lanes)]


def shufflevector(lz: Legalizer, i: Instr) -> list[Value]:
    """Lanes of two vectors picked by a constant mask."""
    lanes = lz.fields(i.args[0]) + lz.fields(i.args[1])
    out: list[Value] = []
    for pick in lz.fields(i.args[2]):
        out.append(lanes[pick.value] if isinstance(pick, ConstInt) else Undef(legal_type(i.type.elems[0])))
    return out


def bitcast(lz: LegalizerBase, i: Instr) -> Value | list[Value]:
    """Vector to integer, integer to vector, or between vectors: bit by bit, first lane lowest."""
    source = i.args[0]
    if source.type.kind == "vector" and i.type.kind == "vector":
        return _regroup(lz, lz.fields(source), source.type, i.type)
    whole = lz.use(source) if source.type.kind != "vector" else pack(lz, source)
    return whole if i.type.kind != "vector" else unpack(lz, whole, i.type)


def _regroup(lz: LegalizerBase, parts: list[Value], old: Type, new: Type) -> list[Value]:
    """Lanes of another width from the same bits."""
    have, want = old.elems[0].bits, new.elems[0].bits
    lane = legal_type(new.elems[0])
    if have == want:
        return parts
    if have % want == 0:
        return [lz.b.cast("trunc", lz.b.shift("lshr", v, at), lane) for v in parts for at in range(0, have, want)]
    if want % have:
        whole = _joined(lz, parts, have, packed_type(old))
        return unpack(lz, whole, new)
    step = want // have
    return [_joined(lz, parts[k : k + step], have, lane) for k in range(0, len(parts), step)]


def is_wide(t: Type) -> bool:
    """Vectors of more than eight words, which is what the argument registers hold, travel through memory."""
    return t.kind == "vector" and size_of(t) > 2 * ARGUMENT_REGISTERS


def call(lz: Legalizer, i: Instr, args: list[Value], attrs: list[object]) -> list[Value]:
    """A call whose result is wide: the address of a slot goes first, as for a struct (abi-elf.md §2.2 rule 7)."""
    slot = lz.frame_slot(size_of(i.type))
    new = lz.b.emit("call", VOID, [slot, *args, lz.use(i.args[-1])])
    new.extra = {"attrs": [{}, *attrs], "vararg": i.extra["vararg"], "fixed": i.extra["fixed"], "tail": None}
    return lz.load_aggregate(i.type, slot, 2, False)


def packed_type(t: Type) -> Type:
    """The integer a vector travels in as argument, result or bitcast."""
    bits = t.elems[0].bits * t.count
    if t.elems[0].bits == 1 or bits > 128:
        raise UnsupportedError(f"{t} as one value")
    return legal_type(int_type(bits))


def unpack(lz: LegalizerBase, whole: Value, t: Type) -> list[Value]:
    """Lanes of a vector held in one integer."""
    lane = t.elems[0]
    return [lz.b.cast("trunc", lz.b.shift("lshr", whole, k * lane.bits), legal_type(lane)) for k in range(t.count)]


def pack(lz: LegalizerBase, v: Value) -> Value:
    """A vector as one integer, first lane lowest."""
    return _joined(lz, lz.fields(v), v.type.elems[0].bits, packed_type(v.type))


def _joined(lz: LegalizerBase, parts: list[Value], bits: int, t: Type) -> Value:
    whole: Value = const(t, 0)
    for k, part in enumerate(parts):
        wide = lz.b.shift("shl", lz.b.cast("zext", part, t), k * bits) if t.bits > part.type.bits else part
        whole = lz.b.binary("or", whole, wide)
    return whole
