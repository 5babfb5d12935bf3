"""Legalisation of GNU C vectors: a legal vector is the list of its lanes, like any first-class aggregate.

An operation on vectors becomes one scalar instruction per lane, which the handlers of scalar instructions translate.
"""

from __future__ import annotations

from collections.abc import Callable

from toolchain.abi.target import ARGUMENT_REGISTERS
from toolchain.ir.build import const, legal_type
from toolchain.ir.model import (
    I1,
    VOID,
    ConstInt,
    Instr,
    ParameterAttributes,
    Type,
    Undef,
    UnsupportedError,
    Value,
    size_of,
)
from toolchain.legalize.context import LegalResult
from toolchain.legalize.lanes import Lane
from toolchain.legalize.memory import MemoryLegalizer

Translate = Callable[[Instr], LegalResult]
OWN_HANDLER = frozenset(
    ("extractelement", "insertelement", "shufflevector", "bitcast", "load", "store", "freeze", "call", "ret")
)

REDUCE = "llvm.vector.reduce."
REDUCING_OPERATIONS = frozenset(("add", "mul", "and", "or", "xor", "fadd", "fmul"))
REDUCING_PREDICATES = {"smax": "sgt", "smin": "slt", "umax": "ugt", "umin": "ult"}


def lane_count(i: Instr) -> int:
    """Number of lanes of an instruction that is translated lane by lane; 0 for scalar ones and those with a handler."""
    if i.op in OWN_HANDLER:
        return 0
    for v in (i, *i.args):
        if v.type.kind == "vector":
            return v.type.count
    return 0


def expand(lz: MemoryLegalizer, i: Instr, lanes: int, translate: Translate) -> list[Value]:
    """Translate one scalar instruction per lane."""
    out: list[Value] = []
    for k in range(lanes):
        t = i.type.elems[0] if i.type.kind == "vector" else i.type
        args = [Lane(a, k) if a.type.kind == "vector" else a for a in i.args]
        scalar = Instr(i.op, t, args)
        scalar.blocks, scalar.extra, scalar.line = list(i.blocks), i.extra, i.line
        lz.alive.append(scalar)
        lz.alive.append(args)
        value = translate(scalar)
        assert isinstance(value, Value)
        out.append(value)
    return out


def intrinsic(lz: MemoryLegalizer, i: Instr, translate_call: Translate) -> list[Value]:
    """Translate one scalar call per lane; the callee keeps its name, of which only the first word matters."""
    out: list[Value] = []
    for k in range(i.type.count):
        args = [Lane(a, k) if a.type.kind == "vector" else a for a in i.args]
        scalar = Instr("call", i.type.elems[0], args)
        scalar.extra, scalar.line = i.extra, i.line
        lz.alive.append(args)
        value = translate_call(scalar)
        if not isinstance(value, Value):
            raise UnsupportedError(f"vector operand of {i.args[-1]!r}")
        out.append(value)
    return out


def reduce(lz: MemoryLegalizer, i: Instr, name: str, translate: Translate) -> Value:
    """Translate a reduction: one scalar operation per further lane, from the first lane on."""
    kind = name.removeprefix(REDUCE).split(".")[0]
    vector = i.args[-2]  # fadd and fmul have a start value before it
    values: list[Value] = [*i.args[:-2], *(Lane(vector, k) for k in range(vector.type.count))]
    result = values[0]
    for value in values[1:]:
        steps: list[Instr]
        if kind in REDUCING_OPERATIONS:
            steps = [Instr(kind, i.type, [result, value])]
        elif kind in REDUCING_PREDICATES:
            larger = Instr("icmp", I1, [result, value])
            larger.extra["pred"] = REDUCING_PREDICATES[kind]
            steps = [larger, Instr("select", i.type, [larger, result, value])]
        else:
            raise UnsupportedError(f"vector reduction {kind}")
        for step in steps:
            made = translate(step)
            assert isinstance(made, Value)
            lz.values[id(step)] = made
            lz.alive += [step, step.args]
        result = steps[-1]
    return lz.legal(result)


def extractelement(lz: MemoryLegalizer, i: Instr) -> Value:
    """Build the lane at an index; a variable index becomes a chain of selects."""
    lanes, index = lz.legal_leaves(i.args[0]), i.args[1]
    if isinstance(index, ConstInt):
        return lanes[index.value] if index.value < len(lanes) else Undef(legal_type(i.type))
    at = lz.zero_extended(index)
    result = lanes[0]
    for k in range(1, len(lanes)):
        result = lz.b.select(lz.b.icmp("eq", at, const(at.type, k)), lanes[k], result)
    return result


def insertelement(lz: MemoryLegalizer, i: Instr) -> list[Value]:
    """Return the lanes of the vector with one lane replaced."""
    lanes, new, index = list(lz.legal_leaves(i.args[0])), lz.legal(i.args[1]), i.args[2]
    if isinstance(index, ConstInt):
        if index.value < len(lanes):
            lanes[index.value] = new
        return lanes
    at = lz.zero_extended(index)
    return [lz.b.select(lz.b.icmp("eq", at, const(at.type, k)), new, old) for k, old in enumerate(lanes)]


def shufflevector(lz: MemoryLegalizer, i: Instr) -> list[Value]:
    """Return lanes of two vectors, selected by a constant mask."""
    lanes = lz.legal_leaves(i.args[0]) + lz.legal_leaves(i.args[1])
    out: list[Value] = []
    for index in lz.legal_leaves(i.args[2]):
        out.append(lanes[index.value] if isinstance(index, ConstInt) else Undef(legal_type(i.type.elems[0])))
    return out


def bitcast(lz: MemoryLegalizer, i: Instr) -> LegalResult:
    """Build a bitcast to or from a vector: the same bits, first lane lowest."""
    source = i.args[0]
    return lz.bitcast_to_vector(source, i.type) if i.type.kind == "vector" else lz.packed(source)


def is_wide(t: Type) -> bool:
    """Whether a type is a vector that the argument registers cannot hold; such vectors are passed in memory."""
    return t.kind == "vector" and size_of(t) > 2 * ARGUMENT_REGISTERS


def call(lz: MemoryLegalizer, i: Instr, args: list[Value], attrs: list[ParameterAttributes]) -> list[Value]:
    """Build a call with a wide vector result: its first argument is the result's address (abi-elf.md §2.2 rule 7)."""
    slot = lz.frame_slot(size_of(i.type))
    new = lz.b.emit("call", VOID, [slot, *args, lz.legal(i.args[-1])])
    new.extra = {"attrs": [{}, *attrs], "vararg": i.extra["vararg"], "fixed": i.extra["fixed"], "tail": ""}
    return lz.load_aggregate(i.type, slot, 2, False)
