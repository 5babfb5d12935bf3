"""Typed SSA form of one LLVM module, as Python objects.

All passes over IR use these classes. The layout rules are those of the front end's data layout, which equals XC16's
(abi-elf.md §1.1, §1.2): no type is aligned to more than 2 bytes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TypedDict


class UnsupportedError(Exception):
    """A construct that the compiler does not support. `where` is "file:line" or a function name, if known."""

    def __init__(self, what: str, where: str = "") -> None:
        super().__init__(f"{where}: {what}" if where else what)
        self.what = what
        self.where = where
        self.line: str | None = None  # !dbg reference of the construct, if known


# ---------------------------------------------------------------------------------------------------------------------
# Types. They compare by value; `bits` is 0 for types other than integers and floats.


@dataclass(frozen=True, slots=True)
class Type:
    """One LLVM first-class type. kind: void int wide float ptr array struct func label meta vector opaque."""

    kind: str
    bits: int = 0
    elems: tuple[Type, ...] = ()
    count: int = 0
    packed: bool = False
    vararg: bool = False

    def __str__(self) -> str:
        match self.kind:
            case "int" | "wide":
                return f"i{self.bits}"
            case "float":
                return {16: "half", 32: "float", 64: "double"}.get(self.bits, f"f{self.bits}")
            case "array":
                return f"[{self.count} x {self.elems[0]}]"
            case "vector":
                return f"<{self.count} x {self.elems[0]}>"
            case "struct":
                body = "{ " + ", ".join(map(str, self.elems)) + " }" if self.elems else "{}"
                return f"<{body}>" if self.packed else body
            case "func":
                params = [str(t) for t in self.elems[1:]] + (["..."] if self.vararg else [])
                return f"{self.elems[0]} ({', '.join(params)})"
            case "meta":
                return "metadata"
            case _:
                return self.kind


VOID = Type("void")
PTR = Type("ptr", 16)
LABEL = Type("label")
META = Type("meta")
MAX_INT_BITS = 128  # greatest width of kind int in the input; products with overflow check have twice as many bits
MAX_WIDE_BITS = 1 << 15  # greatest width of kind wide: integers that hold long runs of bit-fields
_INTS = {n: Type("int", n) for n in range(1, 2 * MAX_INT_BITS + 17)}
I1, I8, I16, I32, I64 = (_INTS[n] for n in (1, 8, 16, 32, 64))


def int_type(bits: int) -> Type:
    """The integer type of `bits` bits, 1..272; wider ones of the input are `wide_type` (engines.md §5)."""
    found = _INTS.get(bits)
    if found is None:
        raise UnsupportedError(f"integer type i{bits}: wider than {MAX_INT_BITS} bits")
    return found


def wide_type(bits: int) -> Type:
    """The type of integers of 129 bits and more, which are lists of words after legalisation."""
    if bits > MAX_WIDE_BITS:
        raise UnsupportedError(f"integer type i{bits}: wider than {MAX_WIDE_BITS} bits")
    return Type("wide", bits)


def align_of(t: Type) -> int:
    """Alignment in bytes, 1 or 2 (abi-elf.md §1.1)."""
    match t.kind:
        case "int":
            return 1 if t.bits <= 8 else 2
        case "array" | "vector":
            return align_of(t.elems[0])
        case "struct":
            return 1 if t.packed or not t.elems else max(align_of(e) for e in t.elems)
        case _:
            return 2


def store_size(t: Type) -> int:
    """Number of bytes that a load or store of the type accesses."""
    return (t.bits + 7) // 8 if t.kind in ("int", "wide", "float", "ptr") else size_of(t)


def size_of(t: Type) -> int:
    """Size of the type in bytes, including padding at its end."""
    match t.kind:
        case "int" | "wide" | "float" | "ptr":
            n, a = (t.bits + 7) // 8, align_of(t)
            return (n + a - 1) // a * a
        case "array" | "vector":
            return t.count * size_of(t.elems[0])
        case "struct":
            end = struct_offsets(t)[-1] if t.elems else 0
            a = align_of(t)
            return (end + a - 1) // a * a
        case "opaque":
            return 0
        case _:
            raise UnsupportedError(f"size of type {t}")


def struct_offsets(t: Type) -> list[int]:
    """Byte offset of every member, then the end of the last one (abi-elf.md §1.2)."""
    at, out = 0, []
    for e in t.elems:
        a = 1 if t.packed else align_of(e)
        at = (at + a - 1) // a * a
        out.append(at)
        at += size_of(e)
    return [*out, at]


# ---------------------------------------------------------------------------------------------------------------------
# Values


class Value:
    """Base class of all operands."""

    __slots__ = ("type",)

    def __init__(self, type_: Type) -> None:
        self.type = type_


class Const(Value):
    """Constant: a value known at link time."""

    __slots__ = ()


class ConstInt(Const):
    """Integer, null pointer (type ptr, value 0) or the bits of a float. `value` is 0 .. 2^bits-1."""

    __slots__ = ("value",)

    def __init__(self, type_: Type, value: int) -> None:
        super().__init__(type_)
        self.value = value & ((1 << type_.bits) - 1)

    @property
    def signed(self) -> int:
        """The value as two's complement."""
        return self.value - (1 << self.type.bits) if self.value >> (self.type.bits - 1) else self.value

    def __repr__(self) -> str:
        return f"{self.type} {self.signed}"


class Undef(Const):
    """undef or poison: any bit pattern is correct."""

    __slots__ = ()


class ConstZero(Const):
    """zeroinitializer of an aggregate."""

    __slots__ = ()


class ConstAgg(Const):
    """Array or struct of constants."""

    __slots__ = ("elems",)

    def __init__(self, type_: Type, elems: list[Value]) -> None:
        super().__init__(type_)
        self.elems = elems


class ConstBytes(Const):
    """c"..." array of i8."""

    __slots__ = ("data",)

    def __init__(self, type_: Type, data: bytes) -> None:
        super().__init__(type_)
        self.data = data


class GlobalRef(Const):
    """Address of a global variable or function, plus a byte offset."""

    __slots__ = ("name", "offset")

    def __init__(self, name: str, offset: int = 0) -> None:
        super().__init__(PTR)
        self.name = name
        self.offset = offset

    def __repr__(self) -> str:
        return f"@{self.name}+{self.offset}" if self.offset else f"@{self.name}"


class BlockAddress(Const):
    """Address of a basic block (GNU computed goto)."""

    __slots__ = ("block", "function")

    def __init__(self, function: str, block: str) -> None:
        super().__init__(PTR)
        self.function = function
        self.block = block


class ConstExpr(Const):
    """Constant expression that the parser did not fold."""

    __slots__ = ("args", "op")

    def __init__(self, type_: Type, op: str, args: list[Value]) -> None:
        super().__init__(type_)
        self.op = op
        self.args = args


class MetaRef(Value):
    """`metadata !N`, or a value wrapped as metadata."""

    __slots__ = ("ref",)

    def __init__(self, ref: str) -> None:
        super().__init__(META)
        self.ref = ref


class ParameterAttributes(TypedDict, total=False):
    """Attributes of a parameter or argument that the compiler uses."""

    byval: Type
    sret: Type
    elementtype: Type
    align: int
    unaligned_run: bool  # mark of a struct passed by value that abi.struct_alignment sets


class Arg(Value):
    """Function parameter."""

    __slots__ = ("attrs", "index", "name")

    def __init__(self, type_: Type, name: str, index: int, attrs: ParameterAttributes) -> None:
        super().__init__(type_)
        self.name = name
        self.index = index
        self.attrs = attrs

    def __repr__(self) -> str:
        return f"%{self.name}"


class InlineAsm(Value):
    """Inline assembly, the callee of a call."""

    __slots__ = ("constraints", "sideeffect", "text")

    def __init__(self, text: str, constraints: str, sideeffect: bool) -> None:
        super().__init__(PTR)
        self.text = text
        self.constraints = constraints
        self.sideeffect = sideeffect


class InstrExtra(TypedDict, total=False):
    """Fields that only some operations have."""

    pred: str  # icmp, fcmp: predicate
    type: Type  # getelementptr: source element type; alloca: type of the object
    align: int  # load, store, alloca: alignment in bytes
    ordering: str  # atomic load and store, fence, cmpxchg, atomicrmw: memory ordering
    kind: str  # atomicrmw: the operation, such as "add"
    indices: list[int]  # extractvalue, insertvalue: indices of the member
    cases: list[int]  # switch: one value per successor after the default
    assign: str  # store: DIAssignID that links the store to a debug record
    attrs: list[ParameterAttributes]  # call, asm: attributes of every argument
    vararg: bool  # call: the callee is variadic
    fixed: int  # call of a variadic function: number of its named parameters
    tail: str  # call: "tail", "musttail", "notail" or ""
    flags: set[str]  # call: words after the arguments, such as attribute groups
    results: list[Type]  # call and asm with several results: their legal types
    index: int  # callresult, asmresult: index of the result
    divides: str  # call of a division function: the opcode that it replaced
    other: Instr  # division: the `divother` that uses its second result
    signed: bool  # mulhigh: whether the factors are signed
    asm: InlineAsm  # asm: the inline assembly
    name: str  # builtin: its C name
    size: int  # slot: size in bytes
    source: str  # slot: name of the alloca that it replaced
    count: int  # blockcopy, blockfill: number of units
    unit: int  # blockcopy, blockfill: bytes of a unit, 1 or 2
    address: bool  # entryword: the frame address instead of the return address
    argument: Arg  # argword: the struct parameter
    word: int  # argword: index of the word in the parameter


class Instr(Value):
    """One instruction, which is also the value that it defines.

    op      LLVM opcode, or an operation of legal IR
    args    operands; for phi the incoming values, in the order of `blocks`
    blocks  names of successors (br, switch, indirectbr) or of incoming blocks (phi)
    extra   fields that only some operations have
    """

    __slots__ = ("args", "blocks", "extra", "line", "name", "op", "volatile")

    def __init__(self, op: str, type_: Type, args: list[Value], name: str = "") -> None:
        super().__init__(type_)
        self.op = op
        self.args = args
        self.name = name
        self.blocks: list[str] = []
        self.extra: InstrExtra = {}
        self.volatile = False
        self.line: str | None = None  # !dbg metadata reference

    def __repr__(self) -> str:
        return f"%{self.name}" if self.name else self.op

    @property
    def pred(self) -> str:
        """Predicate of icmp and fcmp."""
        return self.extra["pred"]


@dataclass(slots=True)
class Block:
    """Basic block: phis first, one terminator last."""

    name: str
    instrs: list[Instr] = field(default_factory=list)

    @property
    def succs(self) -> list[str]:
        """Names of the successors, each once, in the order of the terminator."""
        return list(dict.fromkeys(self.instrs[-1].blocks))

    def phis(self) -> Iterator[Instr]:
        """Leading phi instructions."""
        for i in self.instrs:
            if i.op != "phi":
                return
            yield i


@dataclass(slots=True)
class Function:
    """Definition or declaration. `blocks` is empty for declarations."""

    name: str
    ret: Type
    args: list[Arg]
    vararg: bool
    linkage: str = ""
    section: str = ""
    attrs: frozenset[str] = frozenset()
    blocks: list[Block] = field(default_factory=list)
    dbg: str | None = None
    align: int = 0
    dbg_records: list[DbgRecord] = field(default_factory=list)


@dataclass(slots=True)
class DbgRecord:
    """Debug record (#dbg_value, #dbg_declare, #dbg_assign): location of a source variable from here on.

    `value` is None if it is unknown. Of an assignment, `address` is the memory written and `link` the DIAssignID of its
    stores. `location` refers to the scope and to the call at which the code was inlined.
    """

    kind: str
    value: Value | None
    variable: str
    expression: str
    block: str
    index: int
    location: str = ""
    address: Value | None = None
    link: str = ""
    words: tuple[Value | None, ...] = ()
    """Words of a struct parameter in registers; None for words that the function does not read."""


@dataclass(slots=True)
class GlobalVar:
    """Global variable; `init` is None for declarations."""

    name: str
    type: Type
    init: Value | None
    constant: bool
    linkage: str = ""
    section: str = ""
    align: int = 0
    dbg: str | None = None
    attrs: frozenset[str] = frozenset()


@dataclass(slots=True)
class Module:
    """Content of one .ll file."""

    source: str = ""
    globals: dict[str, GlobalVar] = field(default_factory=dict)
    functions: dict[str, Function] = field(default_factory=dict)
    aliases: dict[str, Value] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    named_metadata: dict[str, str] = field(default_factory=dict)
    module_asm: list[str] = field(default_factory=list)
    large_data: bool = False  # -mlarge-data: only variables with the attribute `near` are in near memory
    far: frozenset[str] = frozenset()  # variables with an address beyond near memory
