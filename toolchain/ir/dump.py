"""Printer of functions: unlegalised IR as LLVM IR that `read` accepts, legal IR with additional operations."""

from __future__ import annotations

import struct
from collections.abc import Callable

from .model import (
    Arg,
    BlockAddress,
    ConstAgg,
    ConstBytes,
    ConstExpr,
    ConstInt,
    ConstZero,
    Function,
    GlobalRef,
    InlineAsm,
    Instr,
    MetaRef,
    Undef,
    Value,
)


def quoted(name: str) -> str:
    """Identifier after % or @, in quotes if it contains characters that need them."""
    plain = all(ch.isalnum() or ch in "-._$" for ch in name)
    return name if plain and name else '"' + name.replace("\\", "\\5C").replace('"', "\\22") + '"'


class Dumper:
    """Writes one function; values without a name are numbered."""

    def __init__(self, f: Function) -> None:
        self.f = f
        self.names: dict[int, str] = {id(a): f"%{quoted(a.name)}" for a in f.args}
        serial = 0
        for b in f.blocks:
            for i in b.instrs:
                if i.name:
                    self.names[id(i)] = f"%{quoted(i.name)}"
                elif i.type.kind != "void":
                    self.names[id(i)] = f"%t.{serial}"
                    serial += 1

    def text(self) -> str:
        """Text of the whole definition."""
        f = self.f
        params = ", ".join(f"{a.type} {self.names[id(a)]}" for a in f.args)
        dots = ", ..." if f.vararg and f.args else "..." if f.vararg else ""
        lines = [f"define {f.ret} @{quoted(f.name)}({params}{dots}) {{"]
        for b in f.blocks:
            lines.append(f"{quoted(b.name)}:")
            lines += ["  " + self.instruction(i) for i in b.instrs]
        return "\n".join([*lines, "}"])

    def value(self, v: Value) -> str:
        """Operand without its type."""
        match v:
            case Instr() | Arg():
                return self.names.get(id(v), "%?")
            case ConstInt():
                return self._number(v)
            case Undef():
                return "undef"
            case ConstZero():
                return "zeroinitializer"
            case GlobalRef(offset=0):
                return f"@{quoted(v.name)}"
            case GlobalRef():
                return f"getelementptr (i8, ptr @{quoted(v.name)}, i16 {v.offset})"
            case BlockAddress():
                return f"blockaddress(@{quoted(v.function)}, %{quoted(v.block)})"
            case ConstAgg():
                inner = ", ".join(self.typed(e) for e in v.elems)
                return f"[{inner}]" if v.type.kind == "array" else f"{{ {inner} }}"
            case ConstBytes():
                return 'c"' + "".join(f"\\{byte:02X}" for byte in v.data) + '"'
            case InlineAsm():
                effect = "sideeffect " if v.sideeffect else ""
                return f'asm {effect}"{_escaped(v.text)}", "{_escaped(v.constraints)}"'
            case MetaRef():
                return v.ref
            case ConstExpr(args=[a]):
                return f"{v.op} ({self.typed(a)} to {v.type})"
            case ConstExpr():
                return f"{v.op} ({', '.join(self.typed(a) for a in v.args)})"
        return "?"

    def _number(self, v: ConstInt) -> str:
        if v.type.kind == "ptr":
            return "null" if v.value == 0 else f"inttoptr (i16 {v.value} to ptr)"
        if v.type.kind == "float":
            return f"0x{_as_double(v):016X}"
        return ("true" if v.value else "false") if v.type.bits == 1 else str(v.signed)

    def typed(self, v: Value) -> str:
        """Operand with its type."""
        return f"{v.type} {self.value(v)}"

    def instruction(self, i: Instr) -> str:
        """Text of one instruction, without indentation."""
        left = f"{self.names[id(i)]} = " if id(i) in self.names else ""
        return left + self._body(i)

    def _body(self, i: Instr) -> str:
        """Text of one instruction without the name of its result."""
        formatter = FORMATTERS.get(i.op)
        if formatter is not None:
            return formatter(self, i)
        args = i.args
        if len(args) == 2 and args[0].type == i.type:
            return f"{i.op} {self.typed(args[0])}, {self.value(args[1])}"
        extras = ", ".join(f"{k}={v}" for k, v in i.extra.items())
        return f"{i.op} {i.type} " + ", ".join(self.typed(a) for a in args) + (f" ; {extras}" if extras else "")

    def _operands(self, i: Instr) -> str:
        """All operands with their types."""
        return ", ".join(self.typed(a) for a in i.args)

    def _plain(self, i: Instr) -> str:
        return f"{i.op} {self._operands(i)}"

    def _ret(self, i: Instr) -> str:
        return f"ret {self.typed(i.args[0])}" if i.args else "ret void"

    def _br(self, i: Instr) -> str:
        if not i.args:
            return f"br label %{quoted(i.blocks[0])}"
        return f"br {self.typed(i.args[0])}, label %{quoted(i.blocks[0])}, label %{quoted(i.blocks[1])}"

    def _indirectbr(self, i: Instr) -> str:
        return f"indirectbr {self.typed(i.args[0])}, [{', '.join(f'label %{quoted(b)}' for b in i.blocks)}]"

    def _phi(self, i: Instr) -> str:
        pairs = zip(i.args, i.blocks, strict=True)
        return f"phi {i.type} " + ", ".join(f"[ {self.value(a)}, %{quoted(b)} ]" for a, b in pairs)

    def _comparison(self, i: Instr) -> str:
        return f"{i.op} {i.pred} {self.typed(i.args[0])}, {self.value(i.args[1])}"

    def _load(self, i: Instr) -> str:
        return f"load {_volatile(i)}{i.type}, {self.typed(i.args[0])}{_align(i)}"

    def _store(self, i: Instr) -> str:
        return f"store {_volatile(i)}{self._operands(i)}{_align(i)}"

    def _alloca(self, i: Instr) -> str:
        count = f", {self.typed(i.args[0])}" if i.args else ""
        return f"alloca {i.extra['type']}{count}{_align(i)}"

    def _gep(self, i: Instr) -> str:
        return f"getelementptr {i.extra['type']}, {self._operands(i)}"

    def _member(self, i: Instr) -> str:
        return f"{i.op} " + ", ".join([*(self.typed(a) for a in i.args), *map(str, i.extra["indices"])])

    def _conversion(self, i: Instr) -> str:
        return f"{i.op} {self.typed(i.args[0])} to {i.type}"

    def _va_arg(self, i: Instr) -> str:
        return f"va_arg {self.typed(i.args[0])}, {i.type}"

    def _atomicrmw(self, i: Instr) -> str:
        return f"atomicrmw {_volatile(i)}{i.extra['kind']} {self._operands(i)} seq_cst"

    def _cmpxchg(self, i: Instr) -> str:
        return f"cmpxchg {_volatile(i)}{self._operands(i)} seq_cst seq_cst"

    def _no_operands(self, i: Instr) -> str:
        return i.op + (f" {i.extra['ordering']}" if "ordering" in i.extra else "")

    def _switch(self, i: Instr) -> str:
        cases = i.extra["cases"]
        t = i.args[0].type
        rows = " ".join(f"{t} {k}, label %{quoted(b)}" for k, b in zip(cases, i.blocks[1:], strict=True))
        return f"switch {self.typed(i.args[0])}, label %{quoted(i.blocks[0])} [ {rows} ]"

    def _call(self, i: Instr) -> str:
        attrs = i.extra.get("attrs")
        words = []
        for k, a in enumerate(i.args[:-1]):
            given = attrs[k] if attrs is not None else {}
            text = "".join(f" {n}({v})" for n, v in given.items() if n in ("byval", "sret"))
            text += f" align {given['align']}" if "align" in given else ""
            words.append(f"{a.type}{text} {self.value(a)}")
        dots = f" ({', '.join(str(a.type) for a in i.args[:-1])}, ...)" if i.extra.get("vararg") else ""
        return f"call {i.type}{dots} {self.value(i.args[-1])}({', '.join(words)})"


FORMATTERS: dict[str, Callable[[Dumper, Instr], str]] = {
    "ret": Dumper._ret,
    "br": Dumper._br,
    "switch": Dumper._switch,
    "indirectbr": Dumper._indirectbr,
    "phi": Dumper._phi,
    **dict.fromkeys(("icmp", "fcmp"), Dumper._comparison),
    "load": Dumper._load,
    "store": Dumper._store,
    "alloca": Dumper._alloca,
    "getelementptr": Dumper._gep,
    "call": Dumper._call,
    **dict.fromkeys(("extractvalue", "insertvalue"), Dumper._member),
    **dict.fromkeys(
        ("zext", "sext", "trunc", "bitcast", "ptrtoint", "inttoptr", "fptosi", "fptoui", "sitofp", "uitofp", "fpext",
         "fptrunc"),
        Dumper._conversion,
    ),
    **dict.fromkeys(("freeze", "fneg", "select"), Dumper._plain),
    "va_arg": Dumper._va_arg,
    "atomicrmw": Dumper._atomicrmw,
    "cmpxchg": Dumper._cmpxchg,
    **dict.fromkeys(("unreachable", "fence"), Dumper._no_operands),
}  # fmt: skip
"""Formatter by opcode. Opcodes not listed are binary operations or operations of legal IR."""


def _volatile(i: Instr) -> str:
    return "volatile " if i.volatile else ""


def _align(i: Instr) -> str:
    return f", align {i.extra['align']}" if "align" in i.extra else ""


def _escaped(text: str) -> str:
    return "".join(ch if ch.isprintable() and ch not in '"\\' else f"\\{ord(ch):02X}" for ch in text)


def _as_double(v: ConstInt) -> int:
    """Bits of the double with the value of a float constant; LLVM prints every float as a double."""
    if v.type.bits == 64:
        return v.value
    number = struct.unpack("<f", v.value.to_bytes(4, "little"))[0]
    return int.from_bytes(struct.pack("<d", number), "little")


def dump(f: Function) -> str:
    """Text of one function."""
    return Dumper(f).text()
