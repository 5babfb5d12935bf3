"""Legalisation of addresses, loads, stores, locals and atomics; odd addresses are accessed by bytes (isa.md §3)."""

from __future__ import annotations

from toolchain.ir.build import const, legal_type
from toolchain.ir.model import (
    I1,
    I8,
    I16,
    VOID,
    ConstInt,
    GlobalRef,
    Instr,
    Type,
    Undef,
    UnsupportedError,
    Value,
    int_type,
    size_of,
    store_size,
    struct_offsets,
)
from toolchain.legalize.context import AGGREGATES, LegalizationContext, leaves_of

ATOMIC_CALLS = {"__atomic_load", "__atomic_store", "__atomic_exchange", "__atomic_compare_exchange"}


class MemoryLegalizer(LegalizationContext):
    """Handlers of instructions that address or access memory."""

    # -- memory -------------------------------------------------------------------------------------------------------

    def gep(self, i: Instr) -> Value:
        """Build the address of a getelementptr: base + scaled indices + one constant."""
        t = i.extra["type"]
        address, offset = self.legal(i.args[0]), 0
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
            scaled = self.legal(index)
            if scaled.type.bits < 16:
                scaled = self.b.cast("sext", self.sign_extended(index), I16)
            elif scaled.type.bits > 16:
                scaled = self.b.cast("trunc", scaled, I16)
            if stride:
                address = self.b.binary("add", address, self.b.binary("mul", scaled, const(I16, stride)))
        return self.b.binary("add", address, const(I16, offset)) if offset & 0xFFFF else address

    def alloca(self, i: Instr) -> Value:
        """Turn an object of constant size in the entry block into a frame slot, others into run-time allocations."""
        t = i.extra["type"]
        size = size_of(t)
        count = self.legal(i.args[0]) if i.args else const(I16, 1)
        align = i.extra.get("align", 1)
        slack = align if align > 2 else 0
        if isinstance(count, ConstInt) and (self.blocks[0] is self.b.block):
            return self.aligned(self.b.emit("slot", I16, [], size=size * count.value + slack, source=i.name), slack)
        if count.type.bits > 16:
            count = self.b.cast("trunc", count, I16)
        elif count.type.bits < 16:
            count = self.b.cast("zext", count, I16)
        total = self.b.add(self.b.binary("mul", count, const(I16, size)), slack)
        return self.aligned(self.b.emit("dynalloca", I16, [total]), slack)

    def frame_slot(self, size: int) -> Instr:
        """Add an object to the frame; return its address, which is valid in every block."""
        slot = Instr("slot", I16, [])
        slot.extra["size"] = size
        self.blocks[0].instrs.insert(0, slot)
        return slot

    def aligned(self, p: Value, align: int) -> Value:
        """Build the pointer rounded up to a multiple of `align` (0: p itself); the stack is aligned only to 2 bytes."""
        return self.b.binary("and", self.b.add(p, align - 1), const(I16, -align)) if align else p

    def even(self, p: Value, align: int) -> bool:
        """Whether a pointer is known to be even, so that word accesses cause no address error (isa.md §3)."""
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
        p = self.legal(i.args[0])
        align = i.extra.get("align", 2)
        if i.type.kind in AGGREGATES:
            return self.load_aggregate(i.type, p, align, i.volatile)
        t, size, even = legal_type(i.type), store_size(i.type), self.even(p, align)
        value = (
            self.load_atomic(t, size, p, even)
            if "ordering" in i.extra
            else self.load_bits(t, size, p, even, i.volatile)
        )
        return self.to_bool(value) if i.type.bits == 1 else value

    def load_atomic(self, t: Type, size: int, p: Value, even: bool) -> Value:
        """Build an atomic load: one instruction, or an atomic section."""
        if size == 1 or (even and size == 2):
            return self.load_bits(t, size, p, even, True)
        if even and size == 4:
            return self.b.emit("loadpair", t, [p])
        self.begin_atomic()
        value = self.load_bits(t, size, p, even, True)
        self.end_atomic()
        return value

    def load_bits(self, t: Type, size: int, p: Value, even: bool, volatile: bool) -> Value:
        """Build a load of `size` bytes into the low end of a legal type."""
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
        v, p = i.args[0], self.legal(i.args[1])
        align = i.extra.get("align", 2)
        if v.type.kind in AGGREGATES:
            self.store_aggregate(v, p, align, i.volatile)
            return
        if isinstance(v, Undef) and not i.volatile:
            return
        value = self.b.cast("zext", self.legal(v), I8) if v.type.bits == 1 else self.zero_extended(v)
        size, even = store_size(v.type), self.even(p, align)
        if "ordering" in i.extra:
            self.store_atomic(value, size, p, even)
        else:
            self.store_bits(value, size, p, even, i.volatile)

    def store_atomic(self, value: Value, size: int, p: Value, even: bool) -> None:
        """Build an atomic store: one instruction, or an atomic section."""
        if size == 1 or (even and size == 2):
            self.store_bits(value, size, p, even, True)
        elif even and size == 4:
            self.b.emit("storepair", VOID, [value, p])
        else:
            self.begin_atomic()
            self.store_bits(value, size, p, even, True)
            self.end_atomic()

    def store_bits(self, v: Value, size: int, p: Value, even: bool, volatile: bool) -> None:
        """Build a store of the low `size` bytes of a legal value."""
        if even and size * 8 == v.type.bits:
            self.b.store(v, p, volatile)
            return
        if size == 1:
            self.b.store(self.b.cast("trunc", v, I8), p, volatile)
            return
        for at, step in _pieces(size, even):
            part = self.b.cast("trunc", self.b.shift("lshr", v, at * 8) if at else v, I16 if step == 2 else I8)
            self.b.store(part, self.b.add(p, at), volatile)

    def begin_atomic(self) -> None:
        """Start an atomic section: DISI delays interrupts of priority 1-6 (isa.md §12). It has no calls or branches."""
        self.b.emit("builtin", VOID, [], name="__builtin_begin_atomic")

    def end_atomic(self) -> None:
        """End the atomic section."""
        self.b.emit("builtin", VOID, [], name="__builtin_end_atomic")

    def load_aggregate(self, whole: Type, p: Value, align: int, volatile: bool) -> list[Value]:
        out = []
        for t, at in leaves_of(whole):
            q = self.b.add(p, at)
            even = self.even(q, 1 if at & 1 else align)
            out.append(self.load_bits(legal_type(t), store_size(t), q, even, volatile))
        return out

    def store_aggregate(self, v: Value, p: Value, align: int, volatile: bool) -> None:
        for (t, at), part in zip(leaves_of(v.type), self.legal_leaves(v), strict=True):
            q = self.b.add(p, at)
            self.store_bits(part, store_size(t), q, self.even(q, 1 if at & 1 else align), volatile)

    def va_arg(self, i: Instr) -> Value:
        """Build va_arg: decrement the argument pointer by the rounded size, then load (abi-elf.md §2.4)."""
        if i.type.kind not in ("int", "float", "ptr"):
            raise UnsupportedError(f"va_arg of type {i.type}")
        pp = self.legal(i.args[0])
        size = (store_size(i.type) + 1) // 2 * 2
        p = self.b.add(self.b.load(I16, pp), -size)
        self.b.store(p, pp)
        value = self.load_bits(legal_type(i.type), store_size(i.type), p, True, False)
        return self.to_bool(value) if i.type.bits == 1 else value

    # -- atomics ------------------------------------------------------------------------------------------------------

    def atomicrmw(self, i: Instr) -> Value:
        """Build atomicrmw: read, modify and write in an atomic section."""
        kind = str(i.extra["kind"])
        p, v = self.legal(i.args[0]), self.legal(i.args[1])
        t = legal_type(i.type)
        self.begin_atomic()
        old = self.b.load(t, p, True)
        new = self.modified(kind, t, old, v)
        self.b.store(new, p, True)
        self.end_atomic()
        return old

    def modified(self, kind: str, t: Type, old: Value, v: Value) -> Value:
        """Build the value that atomicrmw writes."""
        if kind in ("add", "sub", "and", "or", "xor"):
            return self.b.binary(kind, old, v)
        if kind == "xchg":
            return v
        if kind == "nand":
            return self.b.binary("xor", self.b.binary("and", old, v), const(t, -1))
        if kind in ("max", "min", "umax", "umin"):
            pred = ("u" if kind[0] == "u" else "s") + ("gt" if kind.endswith("max") else "lt")
            return self.b.select(self.b.icmp(pred, old, v), old, v)
        raise UnsupportedError(f"atomicrmw {kind}")

    def cmpxchg(self, i: Instr) -> list[Value]:
        p, expected, new = (self.legal(a) for a in i.args)
        t = legal_type(i.args[1].type)
        self.begin_atomic()
        old = self.b.load(t, p, True)
        same = self.b.icmp("eq", old, expected)
        self.b.store(self.b.select(same, new, old), p, True)
        self.end_atomic()
        return [old, same]

    def atomic_call(self, i: Instr, name: str) -> Value | None:
        """Build a call of one of GCC's generic atomic functions, which the front end emits for _Atomic objects."""
        size, p, *operands = (self.legal(a) for a in i.args[:-2])
        assert isinstance(size, ConstInt)
        n = size.value
        t = I8 if n == 1 else int_type(8 * n)
        even = self.even(p, 1)
        if name == "__atomic_load":
            value = self.load_atomic(t, n, p, even)
            self.store_bits(value, n, operands[0], self.even(operands[0], 1), False)
            return None
        given = operands[1] if name == "__atomic_compare_exchange" else operands[0]
        new = self.load_bits(t, n, given, self.even(given, 1), False)
        if name == "__atomic_store":
            self.store_atomic(new, n, p, even)
            return None
        if name == "__atomic_exchange":
            self.begin_atomic()
            old = self.load_bits(t, n, p, even, True)
            self.store_bits(new, n, p, even, True)
            self.end_atomic()
            self.store_bits(old, n, operands[1], self.even(operands[1], 1), False)
            return None
        where = operands[0]
        expected = self.load_bits(t, n, where, self.even(where, 1), False)
        self.begin_atomic()
        old = self.load_bits(t, n, p, even, True)
        same = self.b.icmp("eq", old, expected)
        self.store_bits(self.b.select(same, new, old), n, p, even, True)
        self.end_atomic()
        self.store_bits(old, n, where, self.even(where, 1), False)  # no change if both are equal
        return same


def _pieces(size: int, even: bool) -> list[tuple[int, int]]:
    """(offset, bytes) of the accesses to `size` bytes."""
    if not even:
        return [(k, 1) for k in range(size)]
    return [(k, 2) for k in range(0, size - 1, 2)] + ([(size - 1, 1)] if size & 1 else [])
