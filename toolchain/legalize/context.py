"""State of the legalisation of one function, and the legal values of its operands."""

from __future__ import annotations

from collections.abc import Callable

from toolchain.ir.build import IrBuilder, const, legal_type
from toolchain.ir.model import (
    I1,
    I16,
    I64,
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
from toolchain.legalize import packing
from toolchain.legalize.lanes import Lane

AGGREGATES = ("struct", "array", "vector", "wide")
LegalResult = Value | list[Value] | None
"""Legal form of one instruction: a value, the leaves of an aggregate, or None if it has no value."""


class LegalizationContext:
    """State for one function. `values` maps old values to legal ones; `aggregates` maps them to their legal leaves."""

    def __init__(self, module: Module, function: Function, locate: Callable[[str | None], str]) -> None:
        self.module = module
        self.function = function
        self.locate = locate  # returns "file:line" of a !dbg reference
        self.values: dict[int, Value] = {}
        self.aggregates: dict[int, list[Value]] = {}
        self.blocks: list[Block] = []
        self.last_block: dict[str, str] = {}  # old block name -> name of the new block that holds its terminator
        self.pending_phis: list[tuple[Instr, list[Value], int | None]] = []  # phi, old operands, leaf index
        self.b = IrBuilder(Block(""))  # appends to the current block
        self.alive: list[object] = []  # objects kept alive, so that their ids, the keys of `values`, stay unique

    def begin(self, name: str) -> Block:
        """Add a new block to the function."""
        block = Block(name)
        self.blocks.append(block)
        return block

    # -- operands -----------------------------------------------------------------------------------------------------

    def legal(self, v: Value) -> Value:
        """The legal value of a scalar operand. Raise UnsupportedError for unsupported kinds of operands."""
        if isinstance(v, Lane):
            return self.legal_leaves(v.source)[v.index]
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
            return self.constant_expression(v)
        if isinstance(v, MetaRef):  # operand of llvm.read_register
            raise UnsupportedError("a global variable in a register: only A and B, the accumulators, can be one")
        raise UnsupportedError(f"operand {v!r} of type {v.type}")

    def constant_expression(self, v: ConstExpr) -> Value:
        """Build the computation of a constant expression at the current position."""
        args = [self.legal(a) for a in v.args]
        if v.op in ("ptrtoint", "inttoptr", "trunc", "zext", "sext", "bitcast", "addrspacecast", "ptrtoaddr"):
            t = legal_type(v.type)
            return self.b.cast(
                "trunc" if t.bits < args[0].type.bits else "sext" if v.op == "sext" else "zext", args[0], t
            )
        return self.b.binary(v.op, args[0], args[1])

    def zero_extended(self, v: Value) -> Value:
        """Legal value with the bits above the original width cleared."""
        new, bits = self.legal(v), v.type.bits
        if v.type.kind == "ptr" or new.type.bits == bits:
            return new
        return self.b.binary("and", new, const(new.type, (1 << bits) - 1))

    def sign_extended(self, v: Value) -> Value:
        """Legal value with the bits above the original width filled with the sign."""
        new, bits = self.legal(v), v.type.bits
        if v.type.kind == "ptr" or new.type.bits == bits:
            return new
        pad = new.type.bits - bits
        return self.b.shift("ashr", self.b.shift("shl", new, pad), pad)

    def to_bool(self, v: Value) -> Value:
        """Bit 0 of a legal value as an i1."""
        if isinstance(v, ConstInt):
            return const(I1, v.value & 1)
        if v.type is I1:
            return v
        if v.type.bits > 16:
            v = self.b.cast("trunc", v, I16)
        return self.b.icmp("ne", self.b.binary("and", v, const(v.type, 1)), const(v.type, 0))

    # -- aggregates in registers --------------------------------------------------------------------------------------

    def legal_leaves(self, v: Value) -> list[Value]:
        """Legal values of the scalar members of an aggregate operand, in memory order."""
        found = self.aggregates.get(id(v))
        if found is not None:
            return found
        leaves = leaves_of(v.type)
        if isinstance(v, Undef):
            return [Undef(legal_type(t)) for t, _ in leaves]
        if isinstance(v, ConstInt):  # of a wide type
            return [const(t, v.value >> 8 * at) for t, at in leaves]
        if isinstance(v, ConstZero):
            return [const(legal_type(t), 0) for t, _ in leaves]
        if isinstance(v, ConstAgg):
            return [
                self.legal(x) if x.type.bits else y
                for x in v.elems
                for y in ([x] if x.type.bits else self.legal_leaves(x))
            ]
        if isinstance(v, ConstExpr) and v.op == "bitcast" and v.type.kind == "vector":
            return self.bitcast_to_vector(v.args[0], v.type)
        raise UnsupportedError(f"aggregate operand of type {v.type}")

    def bitcast_to_vector(self, source: Value, t: Type) -> list[Value]:
        """Lanes of the vector type `t` with the bits of a scalar or vector operand, first lane lowest."""
        if source.type.kind == "vector":
            return packing.regroup(self.b, self.legal_leaves(source), source.type, t)
        return packing.unpack(self.b, self.legal(source), t)

    def packed(self, v: Value) -> Value:
        """A vector operand as one integer with the first lane in the low bits."""
        return packing.pack(self.b, self.legal_leaves(v), v.type)

    def extractvalue(self, i: Instr) -> LegalResult:
        first, count = leaf_range(i.args[0].type, i.extra["indices"])
        parts = self.legal_leaves(i.args[0])[first : first + count]
        return parts if i.type.kind in AGGREGATES else parts[0]

    def insertvalue(self, i: Instr) -> LegalResult:
        first, count = leaf_range(i.type, i.extra["indices"])
        parts = list(self.legal_leaves(i.args[0]))
        v = i.args[1]
        parts[first : first + count] = self.legal_leaves(v) if v.type.kind in AGGREGATES else [self.legal(v)]
        return parts

    # -- arithmetic that several handlers build -----------------------------------------------------------------------

    def multiply(self, a: Value, b: Value) -> Value:
        """Build a product of legal values; a product of 64 bits that is not a shift is a run-time library call."""
        product = self.b.binary("mul", a, b)
        if a.type is I64 and isinstance(product, Instr) and product is self.b.block.instrs[-1] and product.op == "mul":
            self.b.block.instrs.pop()
            return self.b.call("__muldi3", I64, [a, b])
        return product


def leaves_of(t: Type, at: int = 0) -> list[tuple[Type, int]]:
    """Scalar members of an aggregate that starts at offset `at`, with their byte offsets."""
    if t.kind == "wide":
        return [(I16, at + k) for k in range(0, (t.bits + 7) // 8, 2)]
    if t.kind in ("array", "vector"):
        step = size_of(t.elems[0])
        return [leaf for k in range(t.count) for leaf in leaves_of(t.elems[0], at + k * step)]
    if t.kind == "struct":
        offsets = struct_offsets(t)
        return [leaf for e, o in zip(t.elems, offsets, strict=False) for leaf in leaves_of(e, at + o)]
    return [(t, at)]


def leaf_range(t: Type, indices: list[int]) -> tuple[int, int]:
    """Number of the first leaf of the member that `indices` select, and how many leaves the member has."""
    first = 0
    for n in indices:
        members = [t.elems[0]] * t.count if t.kind != "struct" else list(t.elems)
        first += sum(len(leaves_of(m)) for m in members[:n])
        t = members[n]
    return first, len(leaves_of(t))
