"""Parser of types, values and constants; constant expressions of numbers and addresses are folded."""

from __future__ import annotations

import struct

from .lex import (
    BINARY,
    CASTS,
    OPERATION_FLAGS,
    PARAM_WORDS,
    PAREN_ATTRS,
    TYPED_ATTRS,
    UNALIGNED_RUN,
    Cursor,
    name_of,
    unquote,
)
from .model import (
    I1,
    LABEL,
    MAX_INT_BITS,
    META,
    PTR,
    VOID,
    BlockAddress,
    ConstAgg,
    ConstBytes,
    ConstExpr,
    ConstInt,
    ConstZero,
    GlobalRef,
    InlineAsm,
    Instr,
    MetaRef,
    ParameterAttributes,
    Type,
    Undef,
    Value,
    int_type,
    size_of,
    struct_offsets,
    wide_type,
)


class ValueReader:
    """Parser of types and values, with the named types and local values parsed so far."""

    def __init__(self) -> None:
        self.types: dict[str, Type] = {}
        self.locals: dict[str, Value] = {}
        self.forward: dict[str, Instr] = {}

    # -- types --------------------------------------------------------------------------------------------------------

    def type(self, c: Cursor) -> Type:
        """Parse a type, including a function type `ret (params)`."""
        t = self._type1(c)
        if c.peek() == "(" and t.kind != "label":
            c.next()
            params, vararg = [], False
            while not c.accept(")"):
                if c.accept("..."):
                    vararg = True
                else:
                    params.append(self._type1(c))
                c.accept(",")
            t = Type("func", 0, (t, *params), 0, False, vararg)
        return t

    def _type1(self, c: Cursor) -> Type:
        token = c.next()
        if token[0] == "i" and token[1:].isdigit():
            bits = int(token[1:])
            return int_type(bits) if bits <= MAX_INT_BITS else wide_type(bits)
        match token:
            case "ptr":
                if c.accept("addrspace"):
                    c.skip_parens()
                return PTR
            case "void":
                return VOID
            case "float":
                return Type("float", 32)
            case "double":
                return Type("float", 64)
            case "half" | "fp128" | "bfloat" | "x86_fp80":
                raise c.error(f"floating-point type '{token}'")
            case "label":
                return LABEL
            case "metadata":
                return META
            case "opaque":
                return Type("opaque")
            case "[":
                return self._array(c, "array", "]")
            case "{":
                return self._struct(c, False)
            case "<":
                if c.accept("{"):
                    t = self._struct(c, True)
                    c.expect(">")
                    return t
                return self._array(c, "vector", ">")
        if token[0] == "%":
            name = name_of(token)
            if name not in self.types:
                self.types[name] = Type("opaque")
            return self.types[name]
        raise c.error(f"type '{token}'")

    def _array(self, c: Cursor, kind: str, close: str) -> Type:
        count = int(c.next())
        c.expect("x")
        elem = self._type1(c)
        c.expect(close)
        return Type(kind, 0, (elem,), count)

    def _struct(self, c: Cursor, packed: bool) -> Type:
        elems = []
        while not c.accept("}"):
            elems.append(self._type1(c))
            c.accept(",")
        return Type("struct", 0, tuple(elems), 0, packed)

    # -- values -------------------------------------------------------------------------------------------------------

    def typed(self, c: Cursor) -> Value:
        """Parse `type value`."""
        t = self.type(c)
        return self.value(c, t)

    def value(self, c: Cursor, t: Type) -> Value:
        """Parse a value of known type."""
        token = c.next()
        first = token[0]
        if first == "%":
            return self.local(name_of(token), t)
        if first == "@":
            return GlobalRef(name_of(token))
        if first.isdigit() or first in "-+":
            return self._number(c, token, t)
        match token:
            case "true" | "false":
                return ConstInt(I1, token == "true")
            case "null":
                return ConstInt(PTR, 0)
            case "undef" | "poison":
                return Undef(t)
            case "zeroinitializer" | "none":
                return ConstInt(t, 0) if t.bits else ConstZero(t)
            case "[":
                return ConstAgg(t, self._list(c, "]"))
            case "{":
                return ConstAgg(t, self._list(c, "}"))
            case "<" if t.kind == "vector":
                return ConstAgg(t, self._list(c, ">"))
            case "splat":
                c.expect("(")
                lane = self.typed(c)
                c.expect(")")
                return ConstAgg(t, [lane] * t.count)
            case "<":
                c.expect("{")
                elems = self._list(c, "}")
                c.expect(">")
                return ConstAgg(t, elems)
            case "blockaddress":
                c.expect("(")
                function = name_of(c.next())
                c.expect(",")
                block = name_of(c.next())
                c.expect(")")
                return BlockAddress(function, block)
            case "no_cfi" | "dso_local_equivalent":
                return GlobalRef(name_of(c.next()))
            case "asm":
                return self._asm(c)
        if token.startswith('c"'):
            return ConstBytes(t, unquote(token[2:-1]))
        if first == "!":
            return MetaRef(token)
        return self._const_expr(c, token, t)

    def _list(self, c: Cursor, close: str) -> list[Value]:
        elems: list[Value] = []
        while not c.accept(close):
            elems.append(self.typed(c))
            c.accept(",")
        return elems

    def _number(self, c: Cursor, token: str, t: Type) -> Value:
        if t.kind == "float":
            if token.startswith("0x"):
                if token[2] in "KLMHR":
                    raise c.error(f"floating-point constant {token}")
                bits64 = int(token, 16)
            else:
                bits64 = int.from_bytes(struct.pack("<d", float(token)), "little")
            return ConstInt(t, bits64 if t.bits == 64 else _narrow(bits64))
        if t.kind not in ("int", "wide", "ptr"):
            raise c.error(f"number {token} of type {t}")
        return ConstInt(t, int(token, 0))

    def _asm(self, c: Cursor) -> InlineAsm:
        sideeffect = c.accept("sideeffect")
        c.accept("alignstack")
        c.accept("inteldialect")
        c.accept("unwind")
        text = unquote(c.next()[1:-1]).decode("latin-1")
        c.expect(",")
        return InlineAsm(text, unquote(c.next()[1:-1]).decode(), sideeffect)

    def _const_expr(self, c: Cursor, op: str, t: Type) -> Value:
        if op not in BINARY | CASTS | {"getelementptr"}:
            raise c.error(f"constant expression '{op}'")
        while c.peek() in OPERATION_FLAGS:
            c.next()
        if c.accept("inrange"):
            c.skip_parens()
        c.expect("(")
        if op == "getelementptr":
            source = self.type(c)
            c.expect(",")
            args = [self.typed(c)]
            while c.accept(","):
                args.append(self.typed(c))
            c.expect(")")
            return _fold_gep(c, source, args)
        args = [self.typed(c)]
        if op in CASTS:
            c.expect("to")
            target = self.type(c)
            c.expect(")")
            return _fold_cast(op, args[0], target)
        c.expect(",")
        args.append(self.typed(c))
        c.expect(")")
        return _fold_binary(op, t, args)

    def local(self, name: str, t: Type) -> Value:
        """The local value of that name, or a placeholder that `_resolve` replaces."""
        found = self.locals.get(name)
        if found is None:
            found = self.forward.get(name)
            if found is None:
                found = self.forward[name] = Instr("forward", t, [], name)
        return found

    def _attrs(self, c: Cursor) -> ParameterAttributes:
        """Parse parameter or result attributes."""
        attrs: ParameterAttributes = {}
        while True:
            word = c.peek()
            if word in TYPED_ATTRS:
                c.next()
                c.expect("(")
                t = self.type(c)
                if word == "byval":
                    attrs["byval"] = t
                elif word == "sret":
                    attrs["sret"] = t
                elif word == "elementtype":
                    attrs["elementtype"] = t
                c.expect(")")
            elif word == "align":
                c.next()
                attrs["align"] = int(c.skip_parens()[0] if c.peek() == "(" else c.next())
            elif word in PAREN_ATTRS:
                c.next()
                c.skip_parens()
            elif word in PARAM_WORDS or word.startswith('"'):
                c.next()
                if word == UNALIGNED_RUN:
                    attrs["unaligned_run"] = True
                if c.accept("="):
                    c.next()
            else:
                return attrs


def _narrow(bits64: int) -> int:
    """Bits of the float whose value the given bits of a double have; LLVM prints floats as doubles."""
    value = struct.unpack("<d", bits64.to_bytes(8, "little"))[0]
    if value != value:  # NaN: keep the sign and the upper bits of the payload
        return (bits64 >> 63) << 31 | 0x7F800000 | ((bits64 >> 29) & 0x7FFFFF)
    return int.from_bytes(struct.pack("<f", value), "little")


def _fold_gep(c: Cursor, source: Type, args: list[Value]) -> Value:
    """Fold a constant getelementptr to base plus offset."""
    base, offset, t = args[0], 0, source
    symbolic: list[Value] = []
    for k, index in enumerate(args[1:]):
        if not isinstance(index, ConstInt):
            t = t.elems[0] if k else t
            symbolic.append(ConstExpr(PTR, "mul", [index, ConstInt(PTR, size_of(t))]) if size_of(t) != 1 else index)
        elif k == 0:
            offset += index.signed * size_of(t)
        elif t.kind == "struct":
            offset += struct_offsets(t)[index.value]
            t = t.elems[index.value]
        else:
            t = t.elems[0]
            offset += index.signed * size_of(t)
    if isinstance(base, GlobalRef):
        base = GlobalRef(base.name, base.offset + offset)
    elif isinstance(base, ConstInt):
        base = ConstInt(PTR, base.value + offset)
    else:
        base = ConstExpr(PTR, "add", [base, ConstInt(PTR, offset)])
    for term in symbolic:
        base = ConstExpr(PTR, "add", [base, term])
    return base


def _fold_cast(op: str, a: Value, t: Type) -> Value:
    if isinstance(a, ConstInt):
        return ConstInt(t, a.signed if op == "sext" else a.value)
    if op in ("ptrtoint", "inttoptr", "bitcast", "addrspacecast", "ptrtoaddr") and t.bits == 16:
        return a
    return ConstExpr(t, op, [a])


def _fold_binary(op: str, t: Type, args: list[Value]) -> Value:
    a, b = args
    if isinstance(b, ConstInt) and isinstance(a, GlobalRef) and op in ("add", "sub"):
        return GlobalRef(a.name, a.offset + (b.signed if op == "add" else -b.signed))
    if isinstance(a, ConstInt) and isinstance(b, GlobalRef) and op == "add":
        return GlobalRef(b.name, b.offset + a.signed)
    return ConstExpr(t, op, args)
