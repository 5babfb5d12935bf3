"""State and operands of legalisation: how an old value is looked up as legal ones."""

from __future__ import annotations

from collections.abc import Callable

from toolchain.ir.build import Builder, const, legal_type
from toolchain.ir.model import (
    I1,
    I16,
    Block,
    BlockAddress,
    ConstAgg,
    ConstExpr,
    ConstInt,
    ConstZero,
    Function,
    GlobalRef,
    InlineAsm,
    Instr,
    MetaRef,
    Module,
    Type,
    Undef,
    UnsupportedError,
    Value,
    size_of,
    struct_offsets,
)
from toolchain.legalize import vectors
from toolchain.legalize.lanes import Lane

AGGREGATES = ("struct", "array", "vector")


class LegalizerBase:
    """State for one function. `values` maps old values to legal ones; aggregates map to lists of legal values."""

    def __init__(self, module: Module, function: Function, where: Callable[[str | None], str]) -> None:
        self.module = module
        self.function = function
        self.where = where
        self.values: dict[int, Value] = {}
        self.parts: dict[int, list[Value]] = {}
        self.blocks: list[Block] = []
        self.tail: dict[str, str] = {}  # old block name -> name of the new block that holds its terminator
        self.fixups: list[tuple[Instr, list[Value], int | None]] = []  # phi, old operands, leaf of an aggregate
        self.b = Builder(Block(""))  # where instructions go; set per block
        self.alive: list[object] = []  # keeps ids in `values` unique while the map lives

    def begin(self, name: str) -> Block:
        """Start a new block; instructions go there from now on."""
        block = Block(name)
        self.blocks.append(block)
        return block

    # -- operands -----------------------------------------------------------------------------------------------------

    def use(self, v: Value) -> Value:
        """The legal value that stands for an operand."""
        if isinstance(v, Lane):
            return self.fields(v.source)[v.index]
        found = self.values.get(id(v))
        if found is not None:
            return found
        if isinstance(v, ConstInt):
            t = legal_type(v.type)
            return v if t is v.type else const(t, v.value)
        if isinstance(v, Undef):
            return Undef(legal_type(v.type))
        if isinstance(v, GlobalRef | BlockAddress):
            v.type = I16
            return v
        if isinstance(v, InlineAsm):
            return v
        if isinstance(v, ConstExpr):
            return self.const_expr(v)
        if isinstance(v, MetaRef):  # what clang calls llvm.read_register with
            raise UnsupportedError("a global variable in a register: only A and B, the accumulators, can be one")
        raise UnsupportedError(f"operand {v!r} of type {v.type}")

    def const_expr(self, v: ConstExpr) -> Value:
        """A constant expression computed in place."""
        args = [self.use(a) for a in v.args]
        if v.op in ("ptrtoint", "inttoptr", "trunc", "zext", "sext", "bitcast", "addrspacecast", "ptrtoaddr"):
            t = legal_type(v.type)
            return self.b.cast(
                "trunc" if t.bits < args[0].type.bits else "sext" if v.op == "sext" else "zext", args[0], t
            )
        return self.b.binary(v.op, args[0], args[1])

    def zero_extended(self, v: Value) -> Value:
        """Legal value with the bits above the original width cleared."""
        new, bits = self.use(v), v.type.bits
        if v.type.kind == "ptr" or new.type.bits == bits:
            return new
        return self.b.binary("and", new, const(new.type, (1 << bits) - 1))

    def sign_extended(self, v: Value) -> Value:
        """Legal value with the bits above the original width filled with the sign."""
        new, bits = self.use(v), v.type.bits
        if v.type.kind == "ptr" or new.type.bits == bits:
            return new
        pad = new.type.bits - bits
        return self.b.shift("ashr", self.b.shift("shl", new, pad), pad)

    def to_bool(self, v: Value) -> Value:
        """Bit 0 of a value as a clean i1."""
        if isinstance(v, ConstInt):
            return const(I1, v.value & 1)
        if v.type is I1:
            return v
        if v.type.bits > 16:
            v = self.b.cast("trunc", v, I16)
        return self.b.icmp("ne", self.b.binary("and", v, const(v.type, 1)), const(v.type, 0))

    # -- aggregates in registers --------------------------------------------------------------------------------------

    def fields(self, v: Value) -> list[Value]:
        """Leaves of a first-class aggregate, in memory order."""
        found = self.parts.get(id(v))
        if found is not None:
            return found
        leaves = leaves_of(v.type)
        if isinstance(v, Undef):
            return [Undef(legal_type(t)) for t, _ in leaves]
        if isinstance(v, ConstZero):
            return [const(legal_type(t), 0) for t, _ in leaves]
        if isinstance(v, ConstAgg):
            return [
                self.use(x) if x.type.bits else y for x in v.elems for y in ([x] if x.type.bits else self.fields(x))
            ]
        if isinstance(v, ConstExpr) and v.op == "bitcast" and v.type.kind == "vector":
            lanes = vectors.bitcast(self, Instr("bitcast", v.type, v.args))
            assert isinstance(lanes, list)
            return lanes
        raise UnsupportedError(f"aggregate operand of type {v.type}")

    def extractvalue(self, i: Instr) -> Value | list[Value]:
        indices = i.extra["indices"]
        assert isinstance(indices, list)
        first, count = leaf_range(i.args[0].type, indices)
        parts = self.fields(i.args[0])[first : first + count]
        return parts if i.type.kind in AGGREGATES else parts[0]

    def insertvalue(self, i: Instr) -> list[Value]:
        indices = i.extra["indices"]
        assert isinstance(indices, list)
        first, count = leaf_range(i.type, indices)
        parts = list(self.fields(i.args[0]))
        v = i.args[1]
        parts[first : first + count] = self.fields(v) if v.type.kind in AGGREGATES else [self.use(v)]
        return parts


def leaves_of(t: Type, at: int = 0) -> list[tuple[Type, int]]:
    """Scalar members of an aggregate with their offsets."""
    if t.kind in ("array", "vector"):
        step = size_of(t.elems[0])
        return [leaf for k in range(t.count) for leaf in leaves_of(t.elems[0], at + k * step)]
    if t.kind == "struct":
        offsets = struct_offsets(t)
        return [leaf for e, o in zip(t.elems, offsets, strict=False) for leaf in leaves_of(e, at + o)]
    return [(t, at)]


def leaf_range(t: Type, indices: list[int]) -> tuple[int, int]:
    """Position of a member among the leaves, and how many leaves it has."""
    first = 0
    for n in indices:
        members = [t.elems[0]] * t.count if t.kind != "struct" else list(t.elems)
        first += sum(len(leaves_of(m)) for m in members[:n])
        t = members[n]
    return first, len(leaves_of(t))
