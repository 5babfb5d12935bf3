"""IR -> legal IR: only i1, i8, i16 and multiples of 16 bits; pointers are i16, floats are their bits.

Needs: a function as read. Ensures: no getelementptr, aggregate, float or wide-divide operation is left; those became
address arithmetic, several values, or calls of the run-time library (abi-elf.md §2.8). An iN of odd width lives in
the next legal container with undefined upper bits, which are cleared or sign-filled where an operation looks at them.
"""

from __future__ import annotations

from collections.abc import Callable

from ..ir.model import (
    I1,
    I8,
    I16,
    I64,
    VOID,
    Arg,
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
    Module,
    Type,
    Undef,
    UnsupportedError,
    Value,
    int_type,
    size_of,
    store_size,
    struct_offsets,
)
from ..target import ARGUMENT_REGISTERS
from . import intrinsics, softfloat, vectors
from .build import Builder, const, legal_type
from .cfg import reverse_postorder

AGGREGATES = ("struct", "array", "vector")
SIGNED_OPS = frozenset(("sdiv", "srem", "ashr"))
CLEAN_OPS = frozenset(("udiv", "urem", "lshr", "sdiv", "srem", "ashr"))
DIVIDE_NAMES = {"udiv": "__udiv{}3", "sdiv": "__div{}3", "urem": "__umod{}3", "srem": "__mod{}3"}
LIBGCC_MODE = {32: "si", 64: "di", 128: "ti"}


class Legalizer:
    """State for one function. `values` maps old values to legal ones; aggregates map to lists of legal values."""

    def __init__(self, module: Module, function: Function, where: Callable[[str | None], str]) -> None:
        self.module = module
        self.function = function
        self.where = where
        self.values: dict[int, Value] = {}
        self.parts: dict[int, list[Value]] = {}
        self.blocks: list[Block] = []
        self.tail: dict[str, str] = {}  # old block name -> name of the new block that holds its terminator
        self.fixups: list[tuple[Instr, list[Value]]] = []
        self.serial = 0
        self.alive: list[object] = []  # keeps ids in `values` unique while the map lives

    # -- entry --------------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Rewrite the function in place."""
        f = self.function
        old_args, f.args = f.args, []
        for a in old_args:
            passed = [vectors.packed_type(a.type)] if a.type.kind == "vector" else [t for t, _ in _leaves(a.type)]
            leaves = [Arg(legal_type(t), a.name, a.index, a.attrs) for t in passed]
            f.args += leaves
            if a.type.kind in ("struct", "array"):
                self.parts[id(a)] = list(leaves)
            else:
                self.values[id(a)] = leaves[0]
        entry = True
        for block in reverse_postorder(f):  # definitions before uses, whatever the textual order
            self.b = Builder(self.begin(block.name))
            if entry:
                entry = False
                for a in old_args:
                    if a.type.kind == "vector":
                        self.parts[id(a)] = vectors.unpack(self, self.values.pop(id(a)), a.type)
                    elif id(a) in self.values:
                        self.values[id(a)] = self.argument(a)
            for i in block.instrs:
                self.b.line = i.line
                try:
                    self.instr(i)
                except UnsupportedError as e:
                    raise UnsupportedError(e.what, e.where or self.where(i.line) or f.name) from e
            self.tail[block.name] = self.b.block.name
        for phi, args in self.fixups:
            phi.args = [self.use(a) for a in args]
            phi.blocks = [self.tail[n] for n in phi.blocks]
        for record in f.dbg_records:
            if record.value is not None and not isinstance(record.value, ConstInt):
                record.value = self.values.get(id(record.value))
        f.ret = legal_type(f.ret)
        made = {b.name: b for b in self.blocks}
        f.blocks = [made[b.name] for b in f.blocks]

    def argument(self, old: Arg) -> Value:
        """i1 and odd widths arrive with undefined upper bits (abi-elf.md §2.2): make i1 clean."""
        new = self.values[id(old)]
        if old.type is I1 or old.type.bits == 1:
            clean = self.b.emit("and", I16, [self.b.emit("bits", I16, [new]), const(I16, 1)])
            return self.b.emit("trunc", I1, [clean])
        return new

    def begin(self, name: str) -> Block:
        """Start a new block; instructions go there from now on."""
        block = Block(name)
        self.blocks.append(block)
        return block

    def fresh(self, hint: str) -> str:
        """A block name nobody uses."""
        self.serial += 1
        return f"{hint}.L{self.serial}"

    # -- operands -----------------------------------------------------------------------------------------------------

    def use(self, v: Value) -> Value:
        """The legal value that stands for an operand."""
        if isinstance(v, vectors.Lane):
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

    # -- instructions -------------------------------------------------------------------------------------------------

    def instr(self, i: Instr) -> None:
        """Translate one instruction and record its value."""
        lanes = vectors.lane_count(i)
        result = vectors.expand(self, i, lanes) if lanes else self.translate(i)
        if isinstance(result, list):
            self.parts[id(i)] = result
        elif result is not None:
            self.values[id(i)] = result
            self.alive.append(i)

    def translate(self, i: Instr) -> Value | list[Value] | None:
        """Translate one instruction without recording its value."""
        handler = HANDLERS.get(i.op)
        if handler is None:
            raise UnsupportedError(f"instruction '{i.op}'")
        return handler(self, i)

    def binary(self, i: Instr) -> Value:
        op, t = i.op, i.type
        if t.kind == "float":
            return softfloat.binary(self.b, op, t.bits, self.use(i.args[0]), self.use(i.args[1]))
        extend = self.sign_extended if op in SIGNED_OPS else self.zero_extended
        if op in ("shl", "lshr", "ashr"):
            a = self.use(i.args[0]) if op == "shl" else extend(i.args[0])
            return self.b.binary(op, a, self.zero_extended(i.args[1]))
        if op in CLEAN_OPS:
            return self.divide(op, extend(i.args[0]), extend(i.args[1]))
        a, b = self.use(i.args[0]), self.use(i.args[1])
        return self.multiply(a, b) if op == "mul" else self.b.binary(op, a, b)

    def multiply(self, a: Value, b: Value) -> Value:
        """Products up to 48 bits and by constants stay; wider ones are calls (64 bits) or schoolbook sums."""
        product = self.b.binary("mul", a, b)
        if a.type is I64 and isinstance(product, Instr) and product is self.b.block.instrs[-1] and product.op == "mul":
            self.b.block.instrs.pop()
            return self.b.call("__muldi3", I64, [a, b])
        return product

    def divide(self, op: str, a: Value, b: Value) -> Value:
        """8 and 16 bits use the DIV instruction, wider ones the run-time library."""
        bits = a.type.bits
        signed = op in SIGNED_OPS
        if bits <= 16:
            ext = "sext" if signed else "zext"
            if bits < 16:
                wide = self.b.binary(op, self.b.cast(ext, a, I16), self.b.cast(ext, b, I16))
                return self.b.cast("trunc", wide, a.type)
            return self.b.binary(op, a, b)
        if not signed and isinstance(b, ConstInt) and b.value and b.value & (b.value - 1) == 0:
            return self.b.binary(op, a, b)
        width = next(w for w in (32, 64, 128) if w >= bits)
        t = int_type(width)
        ext = "sext" if signed else "zext"
        name = DIVIDE_NAMES[op].format(LIBGCC_MODE[width])
        if width == 128:
            raise UnsupportedError(f"{bits}-bit division")
        wide = self.b.call(name, t, [self.b.cast(ext, a, t), self.b.cast(ext, b, t)])
        return self.b.cast("trunc", wide, a.type)

    def fneg(self, i: Instr) -> Value:
        a = self.use(i.args[0])
        return self.b.binary("xor", a, const(a.type, 1 << (a.type.bits - 1)))

    def icmp(self, i: Instr) -> Value:
        extend = self.sign_extended if i.pred[0] == "s" else self.zero_extended
        a, b = extend(i.args[0]), extend(i.args[1])
        return self.b.icmp(i.pred, a, b)

    def fcmp(self, i: Instr) -> Value:
        return softfloat.compare(self.b, i.pred, i.args[0].type.bits, self.use(i.args[0]), self.use(i.args[1]))

    def select(self, i: Instr) -> Value | list[Value]:
        if i.type.kind in AGGREGATES:
            c = self.use(i.args[0])
            return [self.b.select(c, a, b) for a, b in zip(self.fields(i.args[1]), self.fields(i.args[2]), strict=True)]
        return self.b.select(self.use(i.args[0]), self.use(i.args[1]), self.use(i.args[2]))

    def freeze(self, i: Instr) -> Value | list[Value]:
        if i.type.kind in AGGREGATES:
            return [const(p.type, 0) if isinstance(p, Undef) else p for p in self.fields(i.args[0])]
        a = self.use(i.args[0])
        return const(a.type, 0) if isinstance(a, Undef) else a

    def cast(self, i: Instr) -> Value | list[Value]:
        a, t = i.args[0], i.type
        if i.op == "bitcast" and "vector" in (a.type.kind, t.kind):
            return vectors.bitcast(self, i)
        target = legal_type(t)
        match i.op:
            case "zext":
                return self.b.cast("zext", self.zero_extended(a), target)
            case "sext":
                return self.b.cast("sext", self.sign_extended(a), target)
            case "trunc":
                low = self.b.cast("trunc", self.use(a), legal_type(t) if t.bits > 1 else self.use(a).type)
                return self.to_bool(low) if t.bits == 1 else low
            case "bitcast" | "addrspacecast":
                return self.use(a)
            case "ptrtoint" | "ptrtoaddr" | "inttoptr":
                value = self.zero_extended(a) if i.op == "inttoptr" else self.use(a)
                low = self.b.cast("trunc" if target.bits < value.type.bits else "zext", value, target)
                return self.to_bool(low) if t.bits == 1 else low
        signed = i.op in ("sitofp", "fptosi")
        if i.op in ("sitofp", "uitofp"):
            return softfloat.from_int(
                self.b, self.sign_extended(a) if signed else self.zero_extended(a), signed, t.bits
            )
        if i.op in ("fptosi", "fptoui"):
            low = softfloat.to_int(self.b, self.use(a), signed, target if t.bits > 1 else I8)
            return self.to_bool(low) if t.bits == 1 else low
        return self.b.call("__extendsfdf2" if i.op == "fpext" else "__truncdfsf2", target, [self.use(a)])

    def to_bool(self, v: Value) -> Value:
        """Bit 0 of a value as a clean i1."""
        if isinstance(v, ConstInt):
            return const(I1, v.value & 1)
        if v.type is I1:
            return v
        if v.type.bits > 16:
            v = self.b.cast("trunc", v, I16)
        return self.b.icmp("ne", self.b.binary("and", v, const(v.type, 1)), const(v.type, 0))

    # -- memory -------------------------------------------------------------------------------------------------------

    def gep(self, i: Instr) -> Value:
        """Address arithmetic: base + scaled indices + one constant."""
        t = i.extra["type"]
        assert isinstance(t, Type)
        address, offset = self.use(i.args[0]), 0
        for k, index in enumerate(i.args[1:]):
            if k and t.kind == "struct":
                assert isinstance(index, ConstInt)
                offset += struct_offsets(t)[index.value]
                t = t.elems[index.value]
                continue
            if k:
                t = t.elems[0]
            stride = size_of(t)
            if isinstance(index, ConstInt):
                offset += index.signed * stride
                continue
            scaled = self.use(index)
            if scaled.type.bits < 16:
                scaled = self.b.cast("sext", self.sign_extended(index), I16)
            elif scaled.type.bits > 16:
                scaled = self.b.cast("trunc", scaled, I16)
            if stride:
                address = self.b.binary("add", address, self.b.binary("mul", scaled, const(I16, stride)))
        return self.b.binary("add", address, const(I16, offset)) if offset & 0xFFFF else address

    def alloca(self, i: Instr) -> Value:
        """Fixed-size objects become frame slots, others move the stack pointer."""
        t = i.extra["type"]
        assert isinstance(t, Type)
        size = size_of(t)
        count = self.use(i.args[0]) if i.args else const(I16, 1)
        align = i.extra.get("align", 1)
        assert isinstance(align, int)
        slack = align if align > 2 else 0
        if isinstance(count, ConstInt) and (self.blocks[0] is self.b.block):
            return self.aligned(self.b.emit("slot", I16, [], size=size * count.value + slack), slack)
        if count.type.bits > 16:
            count = self.b.cast("trunc", count, I16)
        elif count.type.bits < 16:
            count = self.b.cast("zext", count, I16)
        total = self.b.add(self.b.binary("mul", count, const(I16, size)), slack)
        return self.aligned(self.b.emit("dynalloca", I16, [total]), slack)

    def aligned(self, p: Value, align: int) -> Value:
        """The next multiple of `align` (0: as is); the stack itself is aligned to 2 only."""
        return self.b.binary("and", self.b.add(p, align - 1), const(I16, -align)) if align else p

    def even(self, p: Value, align: int) -> bool:
        """Whether a pointer is known to be even, so that word accesses do not trap (isa.md §3)."""
        if align >= 2:
            return True
        offset = 0
        while isinstance(p, Instr) and p.op == "add" and isinstance(p.args[1], ConstInt):
            offset += p.args[1].value
            p = p.args[0]
        if isinstance(p, ConstInt):
            return not (p.value + offset) & 1
        if isinstance(p, GlobalRef):
            var = self.module.globals.get(p.name)
            strong = var is not None and var.init is not None and var.linkage in ("", "internal", "private")
            return strong and not (p.offset + offset) & 1
        return isinstance(p, Instr) and p.op in ("slot", "dynalloca") and not offset & 1

    def load(self, i: Instr) -> Value | list[Value]:
        p = self.use(i.args[0])
        if i.type.kind in AGGREGATES:
            return self.load_aggregate(i, p)
        align = i.extra.get("align", 2)
        assert isinstance(align, int)
        self.guard(i)
        t = legal_type(i.type)
        value = self.load_bits(t, store_size(i.type), p, self.even(p, align), i.volatile)
        return self.to_bool(value) if i.type.bits == 1 else value

    def load_bits(self, t: Type, size: int, p: Value, even: bool, volatile: bool) -> Value:
        """Load `size` bytes into the low end of a legal type."""
        if t is I1:
            return self.b.load(I8, p, volatile)
        if even and size * 8 == t.bits:
            return self.b.load(t, p, volatile)
        if size == 1:
            return self.b.cast("zext", self.b.load(I8, p, volatile), t)
        value: Value | None = None
        for at, step in _pieces(size, even):
            part = self.b.load(I16 if step == 2 else I8, self.b.add(p, at), volatile)
            wide = self.b.shift("shl", self.b.cast("zext", part, t), at * 8)
            value = wide if value is None else self.b.binary("or", value, wide)
        assert value is not None
        return value

    def store(self, i: Instr) -> None:
        v, p = i.args[0], self.use(i.args[1])
        if v.type.kind in AGGREGATES:
            self.store_aggregate(v, p, i.volatile)
            return
        if isinstance(v, Undef) and not i.volatile:
            return
        align = i.extra.get("align", 2)
        assert isinstance(align, int)
        self.guard(i)
        value = self.b.cast("zext", self.use(v), I8) if v.type.bits == 1 else self.zero_extended(v)
        self.store_bits(value, store_size(v.type), p, self.even(p, align), i.volatile)

    def store_bits(self, v: Value, size: int, p: Value, even: bool, volatile: bool) -> None:
        """Store the low `size` bytes of a legal value."""
        if even and size * 8 == v.type.bits:
            self.b.store(v, p, volatile)
            return
        if size == 1:
            self.b.store(self.b.cast("trunc", v, I8), p, volatile)
            return
        for at, step in _pieces(size, even):
            part = self.b.cast("trunc", self.b.shift("lshr", v, at * 8) if at else v, I16 if step == 2 else I8)
            self.b.store(part, self.b.add(p, at), volatile)

    def guard(self, i: Instr) -> None:
        """Atomic accesses wider than a word are made with interrupts of priority 1-6 held off (isa.md §12)."""
        if "ordering" in i.extra and store_size(i.args[0].type if i.op == "store" else i.type) > 2:
            self.disi(12)

    def disi(self, cycles: int) -> None:
        self.b.emit("builtin", VOID, [const(I16, cycles)], name="__builtin_disi")

    def load_aggregate(self, i: Instr, p: Value) -> list[Value]:
        out = []
        for t, at in _leaves(i.type):
            q = self.b.add(p, at)
            out.append(self.load_bits(legal_type(t), store_size(t), q, self.even(q, 2), i.volatile))
        return out

    def store_aggregate(self, v: Value, p: Value, volatile: bool) -> None:
        for (t, at), part in zip(_leaves(v.type), self.fields(v), strict=True):
            q = self.b.add(p, at)
            self.store_bits(part, store_size(t), q, self.even(q, 2), volatile)

    # -- aggregates in registers --------------------------------------------------------------------------------------

    def fields(self, v: Value) -> list[Value]:
        """Leaves of a first-class aggregate, in memory order."""
        found = self.parts.get(id(v))
        if found is not None:
            return found
        leaves = _leaves(v.type)
        if isinstance(v, Undef):
            return [Undef(legal_type(t)) for t, _ in leaves]
        if isinstance(v, ConstZero):
            return [const(legal_type(t), 0) for t, _ in leaves]
        if isinstance(v, ConstAgg):
            return [
                self.use(x) if x.type.bits else y for x in v.elems for y in ([x] if x.type.bits else self.fields(x))
            ]
        raise UnsupportedError(f"aggregate operand of type {v.type}")

    def extractvalue(self, i: Instr) -> Value | list[Value]:
        indices = i.extra["indices"]
        assert isinstance(indices, list)
        first, count = _leaf_range(i.args[0].type, indices)
        parts = self.fields(i.args[0])[first : first + count]
        return parts if i.type.kind in AGGREGATES else parts[0]

    def insertvalue(self, i: Instr) -> list[Value]:
        indices = i.extra["indices"]
        assert isinstance(indices, list)
        first, count = _leaf_range(i.type, indices)
        parts = list(self.fields(i.args[0]))
        v = i.args[1]
        parts[first : first + count] = self.fields(v) if v.type.kind in AGGREGATES else [self.use(v)]
        return parts

    # -- control flow -------------------------------------------------------------------------------------------------

    def phi(self, i: Instr) -> Value:
        if i.type.kind in AGGREGATES:
            raise UnsupportedError(f"phi of type {i.type}")
        new = self.b.emit("phi", legal_type(i.type), [])
        new.blocks = list(i.blocks)
        self.fixups.append((new, i.args))
        return new

    def br(self, i: Instr) -> None:
        if not i.args:
            self.jump("br", [], i.blocks)
            return
        c = self.use(i.args[0])
        if isinstance(c, ConstInt | Undef):
            taken = 0 if isinstance(c, ConstInt) and c.value else 1
            dead = i.blocks[1 - taken]
            if dead != i.blocks[taken]:
                self.drop_edge(i, dead)
            self.jump("br", [], [i.blocks[taken]])
        elif i.blocks[0] == i.blocks[1]:
            self.jump("br", [], i.blocks[:1])
        else:
            self.jump("br", [c], i.blocks)

    def drop_edge(self, i: Instr, target: str) -> None:
        """Remove this block from the phis of a successor it no longer reaches."""
        here = next(b.name for b in self.function.blocks if b.instrs and b.instrs[-1] is i)
        for block in self.function.blocks:
            if block.name == target:
                for phi in block.phis():
                    keep = [k for k, n in enumerate(phi.blocks) if n != here]
                    phi.args[:] = [phi.args[k] for k in keep]
                    phi.blocks[:] = [phi.blocks[k] for k in keep]
        for new, old in self.fixups:
            if new in next((b.instrs for b in self.blocks if b.name == target), []):
                keep = [k for k, n in enumerate(new.blocks) if n != here]
                if len(old) == len(new.blocks):
                    old[:] = [old[k] for k in keep]
                new.blocks = [new.blocks[k] for k in keep]

    def jump(self, op: str, args: list[Value], targets: list[str], **extra: object) -> None:
        self.b.emit(op, VOID, args, **extra).blocks = list(targets)

    def switch(self, i: Instr) -> None:
        v = self.zero_extended(i.args[0])
        if isinstance(v, Undef):
            v = const(v.type, 0)
        self.jump("switch", [v], i.blocks, cases=i.extra["cases"])

    def indirectbr(self, i: Instr) -> None:
        self.jump("indirectbr", [self.use(i.args[0])], i.blocks)

    def ret(self, i: Instr) -> None:
        values = [v for a in i.args for v in self.passed(a)]
        if sum(max(1, v.type.bits // 16) for v in values) > ARGUMENT_REGISTERS:
            raise UnsupportedError(f"returning {i.args[0].type} in registers")
        self.jump("ret", values, [])

    def unreachable(self, i: Instr) -> None:
        self.jump("unreachable", [], [])

    def fence(self, i: Instr) -> None:
        """One core, in-order: a fence only orders the compiler, which keeps memory operations in order anyway."""

    # -- calls --------------------------------------------------------------------------------------------------------

    def call(self, i: Instr) -> Value | list[Value] | None:
        callee = i.args[-1]
        if isinstance(callee, GlobalRef):
            if callee.name.startswith("llvm.") and i.type.kind == "vector":
                return vectors.intrinsic(self, i)
            if callee.name.startswith("llvm."):
                return intrinsics.expand(self, i, callee.name)
            if callee.name.startswith("__builtin_"):
                return self.builtin(i, callee.name)
        if isinstance(callee, InlineAsm):
            return self.inline_asm(i, callee)
        args: list[Value] = []
        attrs: list[object] = []
        given = i.extra["attrs"]
        assert isinstance(given, list)
        for a, attr in zip(i.args[:-1], given, strict=True):
            parts = self.passed(a)
            args += parts
            attrs += [attr] * len(parts)
        leaves = [legal_type(t) for t, _ in _leaves(i.type)] if i.type.kind in ("struct", "array") else []
        result = vectors.packed_type(i.type) if i.type.kind == "vector" else legal_type(i.type)
        new = self.b.emit("call", leaves[0] if leaves else result, [*args, self.use(callee)])
        new.extra = {"attrs": attrs, "vararg": i.extra["vararg"], "fixed": i.extra["fixed"], "tail": i.extra["tail"]}
        if leaves:
            new.extra["results"] = leaves
            return [new, *(self.b.emit("callresult", t, [new], index=k) for k, t in enumerate(leaves) if k)]
        if i.type.kind == "vector":
            return vectors.unpack(self, new, i.type)
        return self.clean_result(i.type, new)

    def passed(self, a: Value) -> list[Value]:
        """The values an argument or result travels as."""
        if a.type.kind == "vector":
            return [vectors.pack(self, a)]
        return self.fields(a) if a.type.kind in AGGREGATES else [self.use(a)]

    def clean_result(self, t: Type, new: Value) -> Value | None:
        """i1 results come with undefined upper bits (abi-elf.md §2.3)."""
        if t.bits == 1:
            low = self.b.emit("and", I16, [self.b.emit("bits", I16, [new]), const(I16, 1)])
            return self.b.emit("trunc", I1, [low])
        return new if t is not VOID else None

    def builtin(self, i: Instr, name: str) -> Value | None:
        new = self.b.emit("builtin", legal_type(i.type), [self.use(a) for a in i.args[:-1]], name=name)
        return new if i.type is not VOID else None

    def inline_asm(self, i: Instr, asm: InlineAsm) -> Value | list[Value] | None:
        args = [self.use(a) for a in i.args[:-1]]
        attrs = i.extra["attrs"]
        if i.type is VOID or i.type.kind == "void":
            self.b.emit("asm", VOID, args, asm=asm, attrs=attrs, results=[])
            return None
        types = list(i.type.elems) if i.type.kind == "struct" else [i.type]
        new = self.b.emit(
            "asm", legal_type(types[0]), args, asm=asm, attrs=attrs, results=[legal_type(t) for t in types]
        )
        values: list[Value] = [new]
        for k in range(1, len(types)):
            values.append(self.b.emit("asmresult", legal_type(types[k]), [new], index=k))
        return values if i.type.kind == "struct" else values[0]

    def va_arg(self, i: Instr) -> Value:
        """Step the pointer down by the rounded size, then read (abi-elf.md §2.4)."""
        if i.type.kind not in ("int", "float", "ptr"):
            raise UnsupportedError(f"va_arg of type {i.type}")
        pp = self.use(i.args[0])
        size = (store_size(i.type) + 1) // 2 * 2
        p = self.b.add(self.b.load(I16, pp), -size)
        self.b.store(p, pp)
        value = self.load_bits(legal_type(i.type), store_size(i.type), p, True, False)
        return self.to_bool(value) if i.type.bits == 1 else value

    # -- atomics ------------------------------------------------------------------------------------------------------

    def atomicrmw(self, i: Instr) -> Value:
        """Read, modify, write with interrupts of priority 1-6 held off for the length of the sequence."""
        kind = str(i.extra["kind"])
        p, v = self.use(i.args[0]), self.use(i.args[1])
        t = legal_type(i.type)
        self.disi(8 + 8 * (t.bits // 16))
        old = self.b.load(t, p, True)
        if kind in ("add", "sub", "and", "or", "xor"):
            new = self.b.binary(kind, old, v)
        elif kind == "xchg":
            new = v
        elif kind == "nand":
            new = self.b.binary("xor", self.b.binary("and", old, v), const(t, -1))
        elif kind in ("max", "min", "umax", "umin"):
            pred = ("u" if kind[0] == "u" else "s") + ("gt" if kind.endswith("max") else "lt")
            new = self.b.select(self.b.icmp(pred, old, v), old, v)
        else:
            raise UnsupportedError(f"atomicrmw {kind}")
        self.b.store(new, p, True)
        return old

    def cmpxchg(self, i: Instr) -> list[Value]:
        p, expected, new = (self.use(a) for a in i.args)
        t = legal_type(i.args[1].type)
        self.disi(12 + 10 * (t.bits // 16))
        old = self.b.load(t, p, True)
        same = self.b.icmp("eq", old, expected)
        self.b.store(self.b.select(same, new, old), p, True)
        return [old, same]


def _pieces(size: int, even: bool) -> list[tuple[int, int]]:
    """(offset, bytes) of the accesses that cover `size` bytes."""
    if not even:
        return [(k, 1) for k in range(size)]
    return [(k, 2) for k in range(0, size - 1, 2)] + ([(size - 1, 1)] if size & 1 else [])


def _leaves(t: Type, at: int = 0) -> list[tuple[Type, int]]:
    """Scalar members of an aggregate with their offsets."""
    if t.kind in ("array", "vector"):
        step = size_of(t.elems[0])
        return [leaf for k in range(t.count) for leaf in _leaves(t.elems[0], at + k * step)]
    if t.kind == "struct":
        offsets = struct_offsets(t)
        return [leaf for e, o in zip(t.elems, offsets, strict=False) for leaf in _leaves(e, at + o)]
    return [(t, at)]


def _leaf_range(t: Type, indices: list[int]) -> tuple[int, int]:
    """Position of a member among the leaves, and how many leaves it has."""
    first = 0
    for n in indices:
        members = [t.elems[0]] * t.count if t.kind != "struct" else list(t.elems)
        first += sum(len(_leaves(m)) for m in members[:n])
        t = members[n]
    return first, len(_leaves(t))


HANDLERS: dict[str, Callable[[Legalizer, Instr], Value | list[Value] | None]] = {
    **dict.fromkeys(
        ("add", "sub", "mul", "udiv", "sdiv", "urem", "srem", "and", "or", "xor", "shl", "lshr", "ashr", "fadd", "fsub",
         "fmul", "fdiv", "frem"),
        Legalizer.binary,
    ),
    **dict.fromkeys(
        ("zext", "sext", "trunc", "bitcast", "addrspacecast", "ptrtoint", "inttoptr", "ptrtoaddr", "sitofp", "uitofp",
         "fptosi", "fptoui", "fpext", "fptrunc"),
        Legalizer.cast,
    ),
    "fneg": Legalizer.fneg,
    "icmp": Legalizer.icmp,
    "fcmp": Legalizer.fcmp,
    "select": Legalizer.select,
    "freeze": Legalizer.freeze,
    "getelementptr": Legalizer.gep,
    "alloca": Legalizer.alloca,
    "load": Legalizer.load,
    "store": Legalizer.store,
    "extractvalue": Legalizer.extractvalue,
    "insertvalue": Legalizer.insertvalue,
    "extractelement": vectors.extractelement,
    "insertelement": vectors.insertelement,
    "shufflevector": vectors.shufflevector,
    "phi": Legalizer.phi,
    "br": Legalizer.br,
    "switch": Legalizer.switch,
    "indirectbr": Legalizer.indirectbr,
    "ret": Legalizer.ret,
    "unreachable": Legalizer.unreachable,
    "fence": Legalizer.fence,
    "call": Legalizer.call,
    "va_arg": Legalizer.va_arg,
    "atomicrmw": Legalizer.atomicrmw,
    "cmpxchg": Legalizer.cmpxchg,
}  # fmt: skip


def legalize(module: Module, function: Function, where: Callable[[str | None], str]) -> None:
    """Rewrite one function definition in place. `where` turns a !dbg reference into "file:line"."""
    Legalizer(module, function, where).run()
