"""Legalisation of a function: only i1, i8, i16 and multiples of 16 bits; pointers are i16, floats are their bits.

Needs: a function as parsed. Ensures: no getelementptr, aggregate, float or wide division remains. They become address
arithmetic, several values, or calls of the run-time library (abi-elf.md §2.8). An integer of another width is stored in
the next legal container with undefined upper bits; operations that read these bits clear or sign-extend them first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Unpack

from toolchain.abi.target import ARGUMENT_REGISTERS
from toolchain.ir.build import IrBuilder, const, legal_type
from toolchain.ir.cfg import reverse_postorder
from toolchain.ir.model import (
    I1,
    I8,
    I16,
    VOID,
    Arg,
    Block,
    ConstInt,
    Function,
    GlobalRef,
    InlineAsm,
    Instr,
    InstrExtra,
    Module,
    ParameterAttributes,
    Type,
    Undef,
    UnsupportedError,
    Value,
    int_type,
)
from toolchain.legalize import intrinsics, packing, softfloat, vectors, wide_integers
from toolchain.legalize.context import AGGREGATES, LegalResult, leaves_of
from toolchain.legalize.memory import ATOMIC_CALLS, MemoryLegalizer

SIGNED_OPS = frozenset(("sdiv", "srem", "ashr"))
CLEAN_OPS = frozenset(("udiv", "urem", "lshr", "sdiv", "srem", "ashr"))
DIVIDE_NAMES = {"udiv": "__udiv{}3", "sdiv": "__div{}3", "urem": "__umod{}3", "srem": "__mod{}3"}
LIBGCC_MODE = {32: "si", 64: "di", 128: "ti"}


class Legalizer(MemoryLegalizer):
    """Legalises one function; handlers of arithmetic, control flow and calls."""

    result_address: Arg | None = None  # parameter that holds the address of a result too large for registers

    # -- entry --------------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Rewrite the function in place."""
        f = self.function
        parameters = f.args
        self._legalize_parameters(parameters)
        order = reverse_postorder(f)  # reverse postorder visits definitions before uses
        for block in order:
            self.b = IrBuilder(self.begin(block.name))
            if block is order[0]:
                self._normalise_parameters(parameters)
            self._translate_block(block)
            self.last_block[block.name] = self.b.block.name
        self._complete_phis()
        for record in f.dbg_records:
            if record.value is not None and not isinstance(record.value, ConstInt):
                record.value = self.values.get(id(record.value))
        f.ret = legal_type(f.ret)
        made = {b.name: b for b in self.blocks}
        f.blocks = [made[b.name] for b in f.blocks]

    def _legalize_parameters(self, parameters: list[Arg]) -> None:
        """Replace the function's parameters by legal ones: one per scalar, one for a vector that registers hold."""
        f = self.function
        f.args = []
        if vectors.is_wide(f.ret):
            self.result_address = Arg(I16, "result", 0, {})
            f.args.append(self.result_address)
            f.ret = VOID
        for a in parameters:
            packed = a.type.kind == "vector" and not vectors.is_wide(a.type)
            types = [packing.packed_type(a.type)] if packed else [t for t, _ in leaves_of(a.type)]
            leaves = [Arg(legal_type(t), a.name, a.index, a.attrs) for t in types]
            f.args += leaves
            if a.type.kind in AGGREGATES and not packed:
                self.aggregates[id(a)] = list(leaves)
            else:
                self.values[id(a)] = leaves[0]

    def _normalise_parameters(self, parameters: list[Arg]) -> None:
        """Build the entry code: unpack vectors, clean the values of type i1."""
        for a in parameters:
            if a.type.kind == "vector" and id(a) in self.values:
                self.aggregates[id(a)] = packing.unpack(self.b, self.values.pop(id(a)), a.type)
            elif id(a) in self.values:
                self.values[id(a)] = self.argument(a)

    def _translate_block(self, block: Block) -> None:
        """Translate the instructions of one block; errors get their source position."""
        for i in block.instrs:
            self.b.line = i.line
            try:
                self.instr(i)
            except UnsupportedError as e:
                raise UnsupportedError(e.what, e.where or self.locate(i.line) or self.function.name) from e

    def _complete_phis(self) -> None:
        """Set the operands and block names of every new phi; all values exist now."""
        for phi, args, leaf in self.pending_phis:
            phi.args = [self.legal(a) if leaf is None else self.legal_leaves(a)[leaf] for a in args]
            phi.blocks = [self.last_block[n] for n in phi.blocks]

    def argument(self, old: Arg) -> Value:
        """Legal value of a parameter; callers leave the upper bits of i1 undefined (abi-elf.md §2.2)."""
        new = self.values[id(old)]
        if old.type is I1 or old.type.bits == 1:
            clean = self.b.emit("and", I16, [self.b.emit("bits", I16, [new]), const(I16, 1)])
            return self.b.emit("trunc", I1, [clean])
        return new

    # -- instructions -------------------------------------------------------------------------------------------------

    def instr(self, i: Instr) -> None:
        """Translate one instruction and record its value."""
        lanes = vectors.lane_count(i)
        result = vectors.expand(self, i, lanes, self.translate) if lanes else self.translate(i)
        if isinstance(result, list):
            self.aggregates[id(i)] = result
        elif result is not None:
            self.values[id(i)] = result
            self.alive.append(i)

    def translate(self, i: Instr) -> LegalResult:
        """Translate one instruction without recording its value."""
        if wide_integers.is_wide(i):
            return wide_integers.translate(self, i)
        handler = HANDLERS.get(i.op)
        if handler is None:
            raise UnsupportedError(f"instruction '{i.op}'")
        return handler(self, i)

    def binary(self, i: Instr) -> Value:
        op, t = i.op, i.type
        if t.kind == "float":
            return softfloat.binary(self.b, op, t.bits, self.legal(i.args[0]), self.legal(i.args[1]))
        extend = self.sign_extended if op in SIGNED_OPS else self.zero_extended
        if op in ("shl", "lshr", "ashr"):
            a = self.legal(i.args[0]) if op == "shl" else extend(i.args[0])
            return self.b.binary(op, a, self.zero_extended(i.args[1]))
        if op in CLEAN_OPS:
            return self.divide(op, extend(i.args[0]), extend(i.args[1]))
        a, b = self.legal(i.args[0]), self.legal(i.args[1])
        return self.multiply(a, b) if op == "mul" else self.b.binary(op, a, b)

    def divide(self, op: str, a: Value, b: Value) -> Value:
        """Build a division: DIV for 8 and 16 bits, a run-time library call for wider operands."""
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
        wide.extra["divides"] = op
        return self.b.cast("trunc", wide, a.type)

    def fneg(self, i: Instr) -> Value:
        a = self.legal(i.args[0])
        return self.b.binary("xor", a, const(a.type, 1 << (a.type.bits - 1)))

    def icmp(self, i: Instr) -> Value:
        extend = self.sign_extended if i.pred[0] == "s" else self.zero_extended
        a, b = extend(i.args[0]), extend(i.args[1])
        return self.b.icmp(i.pred, a, b)

    def fcmp(self, i: Instr) -> Value:
        return softfloat.compare(self.b, i.pred, i.args[0].type.bits, self.legal(i.args[0]), self.legal(i.args[1]))

    def select(self, i: Instr) -> LegalResult:
        if i.type.kind in AGGREGATES:
            c = self.legal(i.args[0])
            pairs = zip(self.legal_leaves(i.args[1]), self.legal_leaves(i.args[2]), strict=True)
            return [self.b.select(c, a, b) for a, b in pairs]
        return self.b.select(self.legal(i.args[0]), self.legal(i.args[1]), self.legal(i.args[2]))

    def freeze(self, i: Instr) -> LegalResult:
        if i.type.kind in AGGREGATES:
            return [const(p.type, 0) if isinstance(p, Undef) else p for p in self.legal_leaves(i.args[0])]
        a = self.legal(i.args[0])
        return const(a.type, 0) if isinstance(a, Undef) else a

    def cast(self, i: Instr) -> LegalResult:
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
                low = self.b.cast("trunc", self.legal(a), legal_type(t) if t.bits > 1 else self.legal(a).type)
                return self.to_bool(low) if t.bits == 1 else low
            case "bitcast" | "addrspacecast":
                return self.legal(a)
            case "ptrtoint" | "ptrtoaddr" | "inttoptr":
                value = self.zero_extended(a) if i.op == "inttoptr" else self.legal(a)
                low = self.b.cast("trunc" if target.bits < value.type.bits else "zext", value, target)
                return self.to_bool(low) if t.bits == 1 else low
        signed = i.op in ("sitofp", "fptosi")
        if i.op in ("sitofp", "uitofp"):
            return softfloat.from_int(
                self.b, self.sign_extended(a) if signed else self.zero_extended(a), signed, t.bits
            )
        if i.op in ("fptosi", "fptoui"):
            low = softfloat.to_int(self.b, self.legal(a), signed, target if t.bits > 1 else I8)
            return self.to_bool(low) if t.bits == 1 else low
        return self.b.call("__extendsfdf2" if i.op == "fpext" else "__truncdfsf2", target, [self.legal(a)])

    # -- control flow -------------------------------------------------------------------------------------------------

    def phi(self, i: Instr) -> LegalResult:
        aggregate = i.type.kind in AGGREGATES
        leaves = [t for t, _ in leaves_of(i.type)] if aggregate else [i.type]
        made = [self.b.emit("phi", legal_type(t), []) for t in leaves]
        for number, new in enumerate(made):
            new.blocks = list(i.blocks)
            self.pending_phis.append((new, i.args, number if aggregate else None))
        return list(made) if aggregate else made[0]

    def br(self, i: Instr) -> None:
        if not i.args:
            self.jump("br", [], i.blocks)
            return
        c = self.legal(i.args[0])
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
        """Remove the block of branch `i` from the phis of a successor that it no longer reaches."""
        here = next(b.name for b in self.function.blocks if b.instrs and b.instrs[-1] is i)
        for block in self.function.blocks:
            if block.name == target:
                for phi in block.phis():
                    keep = [k for k, n in enumerate(phi.blocks) if n != here]
                    phi.args[:] = [phi.args[k] for k in keep]
                    phi.blocks[:] = [phi.blocks[k] for k in keep]
        for new, old, _ in self.pending_phis:
            if new in next((b.instrs for b in self.blocks if b.name == target), []):
                keep = [k for k, n in enumerate(new.blocks) if n != here]
                if len(old) == len(new.blocks):
                    old[:] = [old[k] for k in keep]
                new.blocks = [new.blocks[k] for k in keep]

    def jump(self, op: str, args: list[Value], targets: list[str], **extra: Unpack[InstrExtra]) -> None:
        self.b.emit(op, VOID, args, **extra).blocks = list(targets)

    def switch(self, i: Instr) -> None:
        v = self.zero_extended(i.args[0])
        if isinstance(v, Undef):
            v = const(v.type, 0)
        self.jump("switch", [v], i.blocks, cases=i.extra["cases"])

    def indirectbr(self, i: Instr) -> None:
        self.jump("indirectbr", [self.legal(i.args[0])], i.blocks)

    def ret(self, i: Instr) -> None:
        if self.result_address is not None:
            self.store_aggregate(i.args[0], self.result_address, 2, False)
            self.jump("ret", [], [])
            return
        values = [v for a in i.args for v in self.passed_values(a)]
        if sum(max(1, v.type.bits // 16) for v in values) > ARGUMENT_REGISTERS:
            raise UnsupportedError(f"returning {i.args[0].type} in registers")
        self.jump("ret", values, [])

    def unreachable(self, i: Instr) -> None:
        self.jump("unreachable", [], [])

    def fence(self, i: Instr) -> None:
        """Build no code: the CPU executes in order, and the compiler does not reorder memory operations."""

    # -- calls --------------------------------------------------------------------------------------------------------

    def call(self, i: Instr) -> LegalResult:
        callee = i.args[-1]
        if isinstance(callee, GlobalRef):
            if callee.name.startswith(vectors.REDUCE):
                return vectors.reduce(self, i, callee.name, self.translate)
            if callee.name.startswith("llvm.") and i.type.kind == "vector":
                return vectors.intrinsic(self, i, self.call)
            if callee.name.startswith("llvm."):
                return intrinsics.expand(self, i, callee.name)
            if callee.name.startswith("__builtin_"):
                return self.builtin(i, callee.name)
            if callee.name in ATOMIC_CALLS and isinstance(i.args[0], ConstInt) and i.args[0].value in (1, 2, 4, 8):
                return self.atomic_call(i, callee.name)
        if isinstance(callee, InlineAsm):
            return self.inline_asm(i, callee)
        args: list[Value] = []
        attrs: list[ParameterAttributes] = []
        for a, attr in zip(i.args[:-1], i.extra["attrs"], strict=True):
            parts = self.passed_values(a)
            args += parts
            attrs += [attr] * len(parts)
        if vectors.is_wide(i.type):
            return vectors.call(self, i, args, attrs)
        leaves = [legal_type(t) for t, _ in leaves_of(i.type)] if i.type.kind in ("struct", "array") else []
        result = packing.packed_type(i.type) if i.type.kind == "vector" else legal_type(i.type)
        new = self.b.emit("call", leaves[0] if leaves else result, [*args, self.legal(callee)])
        new.extra = {"attrs": attrs, "vararg": i.extra["vararg"], "fixed": i.extra["fixed"], "tail": i.extra["tail"]}
        if leaves:
            new.extra["results"] = leaves
            return [new, *(self.b.emit("callresult", t, [new], index=k) for k, t in enumerate(leaves) if k)]
        if i.type.kind == "vector":
            return packing.unpack(self.b, new, i.type)
        return self.clean_result(i.type, new)

    def passed_values(self, a: Value) -> list[Value]:
        """Legal values in which an argument or result is passed."""
        if a.type.kind == "vector" and not vectors.is_wide(a.type):
            return [self.packed(a)]
        return self.legal_leaves(a) if a.type.kind in AGGREGATES else [self.legal(a)]

    def clean_result(self, t: Type, new: Value) -> Value | None:
        """Legal value of a call's result; callees leave the upper bits of i1 undefined (abi-elf.md §2.3)."""
        if t.bits == 1:
            low = self.b.emit("and", I16, [self.b.emit("bits", I16, [new]), const(I16, 1)])
            return self.b.emit("trunc", I1, [low])
        return new if t is not VOID else None

    def builtin(self, i: Instr, name: str) -> Value | None:
        new = self.b.emit("builtin", legal_type(i.type), [self.legal(a) for a in i.args[:-1]], name=name)
        return new if i.type is not VOID else None

    def inline_asm(self, i: Instr, asm: InlineAsm) -> LegalResult:
        args = [self.legal(a) for a in i.args[:-1]]
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


HANDLERS: dict[str, Callable[[Legalizer, Instr], LegalResult]] = {
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


def legalize(module: Module, function: Function, locate: Callable[[str | None], str]) -> None:
    """Rewrite one function definition in place. `locate` turns a !dbg reference into "file:line"."""
    Legalizer(module, function, locate).run()
