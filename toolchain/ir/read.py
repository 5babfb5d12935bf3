"""LLVM IR text -> `model.Module`.

One pass over the lines; a function body line is one instruction (a switch runs to its closing bracket). Anything outside
the grammar that clang 22 prints for C raises `UnsupportedError` with the line number of the .ll text.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

from .model import (
    I1,
    LABEL,
    META,
    PTR,
    VOID,
    Arg,
    Block,
    BlockAddress,
    ConstAgg,
    ConstBytes,
    ConstExpr,
    ConstInt,
    ConstZero,
    DbgRecord,
    Function,
    GlobalRef,
    GlobalVar,
    InlineAsm,
    Instr,
    MetaRef,
    Module,
    Type,
    Undef,
    UnsupportedError,
    Value,
    int_type,
    size_of,
    struct_offsets,
)

TOKEN = re.compile(
    r"""c"[^"]*"|[%@]"[^"]*"|[%@][-\w.$]+|![\w.]+|"[^"]*"|0x[KLMHR]?[0-9A-Fa-f]+|[-+]?\d+\.\d*(?:[eE][-+]?\d+)?"""
    r"""|-?\d+|\#\d+|[A-Za-z_][\w.]*|\.\.\.|[=,()\[\]{}<>*|!:]"""
)
COMMENT = re.compile(r'^((?:[^";]|"[^"]*")*);.*$')
LINKAGES = {
    "private", "internal", "available_externally", "linkonce", "weak", "common", "appending", "extern_weak",
    "linkonce_odr", "weak_odr", "external",
}  # fmt: skip
IGNORED_WORDS = {
    "dso_local", "dso_preemptable", "default", "hidden", "protected", "unnamed_addr", "local_unnamed_addr",
    "externally_initialized", "thread_local", "dllimport", "dllexport", "ccc", "fastcc", "coldcc",
}  # fmt: skip
FAST_FLAGS = {"nuw", "nsw", "exact", "disjoint", "nneg", "inbounds", "nusw", "samesign", "fast", "nnan", "ninf", "nsz",
              "arcp", "contract", "afn", "reassoc"}  # fmt: skip
BINARY = {
    "add", "sub", "mul", "udiv", "sdiv", "urem", "srem", "and", "or", "xor", "shl", "lshr", "ashr", "fadd", "fsub",
    "fmul", "fdiv", "frem",
}  # fmt: skip
CASTS = {
    "trunc", "zext", "sext", "fptrunc", "fpext", "fptoui", "fptosi", "uitofp", "sitofp", "ptrtoint", "inttoptr",
    "bitcast", "addrspacecast", "ptrtoaddr",
}  # fmt: skip
TYPED_ATTRS = {"byval", "sret", "byref", "inalloca", "preallocated", "elementtype"}
PAREN_ATTRS = {"dereferenceable", "dereferenceable_or_null", "captures", "initializes", "range", "memory", "nofpclass",
               "allocsize", "vscale_range"}  # fmt: skip


def unquote(text: str) -> bytes:
    """Bytes of an LLVM string body, in which \\XX is a byte and everything else itself."""
    return re.sub(
        rb"\\([0-9A-Fa-f]{2}|\\)", lambda m: b"\\" if m[1] == b"\\" else bytes([int(m[1], 16)]), text.encode()
    )


def strip_comment(line: str) -> str:
    """The line without a trailing `; comment`."""
    if ";" not in line:
        return line
    found = COMMENT.match(line)
    return found[1] if found else line


class Cursor:
    """Token stream of one logical line."""

    __slots__ = ("at", "line", "tokens")

    def __init__(self, text: str, line: int) -> None:
        self.tokens = TOKEN.findall(text)
        self.at = 0
        self.line = line

    def peek(self) -> str:
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def next(self) -> str:
        if self.at >= len(self.tokens):
            raise self.error("unexpected end of line")
        token: str = self.tokens[self.at]
        self.at += 1
        return token

    def accept(self, token: str) -> bool:
        if self.at < len(self.tokens) and self.tokens[self.at] == token:
            self.at += 1
            return True
        return False

    def expect(self, token: str) -> None:
        if not self.accept(token):
            raise self.error(f"expected '{token}', found '{self.peek()}'")

    def error(self, what: str) -> UnsupportedError:
        return UnsupportedError(what, f"LLVM IR line {self.line}")

    def skip_parens(self) -> list[str]:
        """Consume a parenthesised group and return the tokens inside."""
        self.expect("(")
        depth, start = 1, self.at
        while depth:
            token = self.next()
            depth += (token == "(") - (token == ")")
        return self.tokens[start : self.at - 1]


def name_of(token: str) -> str:
    """Identifier of a %x, @x, %"x" token."""
    body = token[1:]
    return unquote(body[1:-1]).decode("latin-1") if body.startswith('"') else body


class Reader:
    """Parser state of one module."""

    def __init__(self, text: str) -> None:
        self.lines = text.split("\n")
        self.at = 0
        self.module = Module()
        self.types: dict[str, Type] = {}
        self.attr_groups: dict[str, frozenset[str]] = {}
        self.locals: dict[str, Value] = {}
        self.forward: dict[str, Instr] = {}
        self.pending_attrs: list[tuple[Function, list[str]]] = []

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
            return int_type(int(token[1:]))
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
        if t.kind not in ("int", "ptr"):
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
        while c.peek() in FAST_FLAGS:
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

    # -- module level -------------------------------------------------------------------------------------------------

    def read(self) -> Module:
        """Parse every line of the module."""
        self._named_types()
        while self.at < len(self.lines):
            line = self.lines[self.at]
            self.at += 1
            if not line or line[0] == ";":
                continue
            try:
                self._top_level(line)
            except (ValueError, KeyError, IndexError, TypeError) as e:
                raise UnsupportedError(f"cannot read '{line[:80]}' ({e})", f"LLVM IR line {self.at}") from e
        for function, groups in self.pending_attrs:
            for group in groups:
                function.attrs |= self.attr_groups.get(group, frozenset())
        return self.module

    def _named_types(self) -> None:
        """Named struct types may refer to later ones: resolve them by need, inner first."""
        bodies = {}
        for n, line in enumerate(self.lines):
            if line.startswith("%") and " = type " in line:
                name, body = line.split(" = type ", 1)
                bodies[name_of(name)] = Cursor(body, n + 1)
        original = self._type1

        def resolve(c: Cursor) -> Type:
            token = c.peek()
            if token.startswith("%") and name_of(token) in bodies:
                name = name_of(c.next())
                if name not in self.types:
                    self.types[name] = original(bodies[name])
                return self.types[name]
            return original(c)

        self._type1 = resolve  # type: ignore[method-assign]
        for name in list(bodies):
            if name not in self.types:
                self.types[name] = resolve(bodies[name])
        self._type1 = original  # type: ignore[method-assign]

    def _top_level(self, line: str) -> None:
        if line[0] == "@":
            self._global(line)
        elif line.startswith("define"):
            self._define(line)
        elif line.startswith("declare"):
            f, _ = self._signature(Cursor(strip_comment(line), self.at))
            self.module.functions.setdefault(f.name, f)
        elif line[0] == "!":
            name, body = line[1:].split(" = ", 1)
            target = self.module.metadata if name.isdigit() else self.module.named_metadata
            target[name] = body
        elif line.startswith("attributes"):
            group, body = line[len("attributes ") :].split(" = ", 1)
            words = re.findall(r'"[^"]*"(?:="[^"]*")?|[\w]+(?:\([^)]*\))?', body)
            self.attr_groups[group] = frozenset(w.replace('"', "") for w in words)
        elif line.startswith("source_filename"):
            self.module.source = unquote(line.split('"')[1]).decode()
        elif line.startswith("module asm"):
            self.module.module_asm.append(unquote(line.split('"', 1)[1].rsplit('"', 1)[0]).decode())
        elif not line.startswith(("target", "%", "$", "uselistorder")):
            raise UnsupportedError(f"'{line[:60]}'", f"LLVM IR line {self.at}")

    def _global(self, line: str) -> None:
        c = Cursor(strip_comment(line), self.at)
        name = name_of(c.next())
        c.expect("=")
        linkage, attrs = "", set()
        while c.peek() not in ("global", "constant", "alias", "ifunc"):
            word = c.next()
            if word in LINKAGES:
                linkage = word
            elif word == "thread_local":
                raise c.error(f"thread-local variable '{name}'")
            elif word == "addrspace":
                c.skip_parens()
            elif word not in IGNORED_WORDS:
                raise c.error(f"'{word}' on global '{name}'")
        kind = c.next()
        if kind in ("alias", "ifunc"):
            self.type(c)
            c.expect(",")
            self.module.aliases[name] = self.typed(c)
            return
        t = self.type(c)
        external = linkage in ("external", "extern_weak")
        init = None if external else self.value(c, t)
        var = GlobalVar(name, t, init, kind == "constant", linkage)
        while c.accept(","):
            word = c.next()
            if word == "section":
                var.section = unquote(c.next()[1:-1]).decode()
            elif word == "align":
                var.align = int(c.next())
            elif word == "!dbg":
                var.dbg = c.next()
            elif word == "comdat":
                if c.peek() == "(":
                    c.skip_parens()
            elif word.startswith("!"):
                c.next()
            else:
                attrs.add(word)
        var.attrs = frozenset(attrs)
        self.module.globals[name] = var

    def _signature(self, c: Cursor) -> tuple[Function, list[str]]:
        c.next()
        linkage = ""
        while True:
            word = c.peek()
            if word in LINKAGES:
                linkage = word
            elif word not in IGNORED_WORDS:
                break
            c.next()
        ret_attrs = self._attrs(c)
        ret = self.type_no_func(c)
        name = name_of(c.next())
        c.expect("(")
        args: list[Arg] = []
        vararg = False
        while not c.accept(")"):
            if c.accept("..."):
                vararg = True
                continue
            t = self._type1(c)
            attrs = self._attrs(c)
            arg_name = name_of(c.next()) if c.peek().startswith("%") else str(len(args))
            args.append(Arg(t, arg_name, len(args), attrs))
            c.accept(",")
        f = Function(name, ret, args, vararg, linkage)
        groups = []
        flags = {f"ret:{a}" for a in ret_attrs}
        while c.peek() not in ("", "{"):
            word = c.next()
            if word.startswith("#"):
                groups.append(word)
            elif word == "section":
                f.section = unquote(c.next()[1:-1]).decode()
            elif word == "align":
                f.align = int(c.next())
            elif word == "!dbg":
                f.dbg = c.next()
            elif word.startswith("!"):
                c.next()
            elif c.peek() == "(":
                c.skip_parens()
            elif word not in IGNORED_WORDS:
                flags.add(word)
        f.attrs = frozenset(flags)
        self.pending_attrs.append((f, groups))
        return f, groups

    def type_no_func(self, c: Cursor) -> Type:
        """A result type: a following parenthesis belongs to the function."""
        return self._type1(c)

    def _attrs(self, c: Cursor) -> dict[str, object]:
        """Parameter or result attributes at the cursor."""
        attrs: dict[str, object] = {}
        while True:
            word = c.peek()
            if word in TYPED_ATTRS:
                c.next()
                c.expect("(")
                attrs[word] = self.type(c)
                c.expect(")")
            elif word == "align":
                c.next()
                attrs["align"] = int(c.skip_parens()[0] if c.peek() == "(" else c.next())
            elif word in PAREN_ATTRS:
                c.next()
                c.skip_parens()
            elif word in PARAM_WORDS or word.startswith('"'):
                c.next()
                attrs[word] = True
                if c.accept("="):
                    c.next()
            else:
                return attrs

    # -- function bodies ----------------------------------------------------------------------------------------------

    def _define(self, line: str) -> None:
        c = Cursor(strip_comment(line), self.at)
        f, _ = self._signature(c)
        start = self.at
        self.locals = {a.name: a for a in f.args}
        self.forward = {}
        block: Block | None = None
        while (text := self.lines[self.at]) != "}":
            self.at += 1
            if not text or text[0] == ";" or text.startswith("  uselistorder"):
                continue
            if text[0] != " ":
                block = Block(name_of("%" + text.split(";")[0].rstrip().removesuffix(":")))
                f.blocks.append(block)
                continue
            if block is None:
                block = Block(self._entry_name(f))
                f.blocks.append(block)
            if text.startswith("    #dbg_"):
                self._dbg(f, block, text)
            else:
                self._line(block, text)
        f.text = "\n".join(self.lines[start : self.at])
        self.at += 1
        self._resolve(f)
        self.module.functions[f.name] = f

    def _entry_name(self, f: Function) -> str:
        """The unlabelled entry block takes the next number after the unnamed parameters."""
        return str(sum(1 for a in f.args if a.name.isdigit()))

    def _line(self, block: Block, text: str) -> None:
        n = self.at
        if text.startswith("  switch") or " switch " in text[:10]:
            while "]" not in text:
                text += " " + self.lines[self.at]
                self.at += 1
        c = Cursor(strip_comment(text) if ";" in text else text, n)
        name = ""
        if c.tokens[0][0] == "%" and len(c.tokens) > 1 and c.tokens[1] == "=":
            name = name_of(c.next())
            c.next()
        instr = self._instr(c)
        instr.name = name
        while c.accept(","):
            key = c.next()
            if key == "align":
                instr.extra["align"] = int(c.next())
            elif key == "!dbg":
                instr.line = c.next()
            elif key.startswith("!"):
                c.next()
            else:
                raise c.error(f"trailing '{key}' on {instr.op}")
        if c.peek():
            raise c.error(f"trailing '{c.peek()}' on {instr.op}")
        if name:
            self.locals[name] = instr
        block.instrs.append(instr)

    def _resolve(self, f: Function) -> None:
        """Replace the placeholders of values used before their definition."""
        if not self.forward:
            return
        for block in f.blocks:
            for instr in block.instrs:
                for k, a in enumerate(instr.args):
                    if a.__class__ is Instr and a.op == "forward":
                        instr.args[k] = self.locals[a.name]
        for record in f.dbg_records:
            if isinstance(record.value, Instr) and record.value.op == "forward":
                record.value = self.locals.get(record.value.name)

    def _dbg(self, f: Function, block: Block, text: str) -> None:
        kind = text.strip().split("(", 1)[0][1:]
        if kind not in ("dbg_value", "dbg_declare"):
            return
        c = Cursor(text.strip()[len(kind) + 2 :], self.at)
        if c.peek() == "!" or c.peek().startswith("!"):
            return
        value: Value | None = self.typed(c)
        c.expect(",")
        variable = c.next()
        c.expect(",")
        c.next()
        expression = " ".join(c.skip_parens())
        f.dbg_records.append(DbgRecord(kind, value, variable, expression, block.name, len(block.instrs)))

    def _instr(self, c: Cursor) -> Instr:
        op = c.next()
        if op in ("tail", "musttail", "notail"):
            tail, op = op, c.next()
        else:
            tail = ""
        if op in BINARY:
            self._flags(c)
            t = self._type1(c)
            a = self.value(c, t)
            c.expect(",")
            return Instr(op, t, [a, self.value(c, t)])
        if op in CASTS:
            self._flags(c)
            a = self.typed(c)
            c.expect("to")
            return Instr(op, self.type(c), [a])
        handler = INSTRS.get(op)
        if handler is None:
            raise c.error(f"instruction '{op}'")
        instr = handler(self, c)
        if op == "call":
            instr.extra["tail"] = tail
        return instr

    def _flags(self, c: Cursor) -> set[str]:
        out = set()
        while c.peek() in FAST_FLAGS:
            out.add(c.next())
        return out

    def _load(self, c: Cursor) -> Instr:
        atomic, volatile = c.accept("atomic"), c.accept("volatile")
        t = self.type(c)
        c.expect(",")
        i = Instr("load", t, [self.typed(c)])
        i.volatile = volatile or atomic
        self._ordering(c, i)
        return i

    def _store(self, c: Cursor) -> Instr:
        atomic, volatile = c.accept("atomic"), c.accept("volatile")
        v = self.typed(c)
        c.expect(",")
        i = Instr("store", VOID, [v, self.typed(c)])
        i.volatile = volatile or atomic
        self._ordering(c, i)
        return i

    def _ordering(self, c: Cursor, i: Instr) -> None:
        if c.accept("syncscope"):
            c.skip_parens()
        while c.peek() in ("unordered", "monotonic", "acquire", "release", "acq_rel", "seq_cst"):
            i.extra["ordering"] = c.next()

    def _alloca(self, c: Cursor) -> Instr:
        c.accept("inalloca")
        t = self.type(c)
        i = Instr("alloca", PTR, [])
        i.extra["type"] = t
        while c.peek() == "," and not c.tokens[c.at + 1].startswith("!"):
            if c.tokens[c.at + 1] == "align":
                break
            c.next()
            i.args.append(self.typed(c))
        return i

    def _gep(self, c: Cursor) -> Instr:
        self._flags(c)
        source = self.type(c)
        c.expect(",")
        i = Instr("getelementptr", PTR, [self.typed(c)])
        i.extra["type"] = source
        while c.peek() == "," and not c.tokens[c.at + 1].startswith("!"):
            c.next()
            i.args.append(self.typed(c))
        return i

    def _compare(self, c: Cursor) -> Instr:
        op = c.tokens[c.at - 1]
        self._flags(c)
        pred = c.next()
        t = self.type(c)
        a = self.value(c, t)
        c.expect(",")
        result = Type("vector", 0, (I1,), t.count) if t.kind == "vector" else I1
        i = Instr(op, result, [a, self.value(c, t)])
        i.extra["pred"] = pred
        return i

    def _select(self, c: Cursor) -> Instr:
        self._flags(c)
        cond = self.typed(c)
        c.expect(",")
        a = self.typed(c)
        c.expect(",")
        return Instr("select", a.type, [cond, a, self.typed(c)])

    def _phi(self, c: Cursor) -> Instr:
        self._flags(c)
        t = self.type(c)
        i = Instr("phi", t, [])
        while True:
            c.expect("[")
            i.args.append(self.value(c, t))
            c.expect(",")
            i.blocks.append(name_of(c.next()))
            c.expect("]")
            if c.peek() != "," or c.tokens[c.at + 1].startswith("!"):
                return i
            c.next()

    def _br(self, c: Cursor) -> Instr:
        if c.accept("label"):
            i = Instr("br", VOID, [])
            i.blocks = [name_of(c.next())]
            return i
        i = Instr("br", VOID, [self.typed(c)])
        for _ in range(2):
            c.expect(",")
            c.expect("label")
            i.blocks.append(name_of(c.next()))
        return i

    def _switch(self, c: Cursor) -> Instr:
        i = Instr("switch", VOID, [self.typed(c)])
        c.expect(",")
        c.expect("label")
        i.blocks = [name_of(c.next())]
        c.expect("[")
        cases = []
        while not c.accept("]"):
            v = self.typed(c)
            c.expect(",")
            c.expect("label")
            assert isinstance(v, ConstInt)
            cases.append(v.value)
            i.blocks.append(name_of(c.next()))
        i.extra["cases"] = cases
        return i

    def _indirectbr(self, c: Cursor) -> Instr:
        i = Instr("indirectbr", VOID, [self.typed(c)])
        c.expect(",")
        c.expect("[")
        while not c.accept("]"):
            c.expect("label")
            i.blocks.append(name_of(c.next()))
            c.accept(",")
        return i

    def _ret(self, c: Cursor) -> Instr:
        if c.accept("void"):
            return Instr("ret", VOID, [])
        return Instr("ret", VOID, [self.typed(c)])

    def _plain(self, c: Cursor) -> Instr:
        return Instr(c.tokens[c.at - 1], VOID, [])

    def _unary(self, c: Cursor) -> Instr:
        op = c.tokens[c.at - 1]
        self._flags(c)
        a = self.typed(c)
        return Instr(op, a.type, [a])

    def _operands(self, c: Cursor) -> list[Value]:
        """`type value, type value...` up to the attachments."""
        args = [self.typed(c)]
        while c.peek() == "," and not c.tokens[c.at + 1].startswith("!"):
            c.next()
            args.append(self.typed(c))
        return args

    def _lane(self, c: Cursor) -> Instr:
        op = c.tokens[c.at - 1]
        args = self._operands(c)
        t = args[0].type
        if op == "extractelement":
            t = t.elems[0]
        elif op == "shufflevector":
            t = Type("vector", 0, t.elems, args[2].type.count)
        return Instr(op, t, args)

    def _extractvalue(self, c: Cursor) -> Instr:
        a = self.typed(c)
        indices = []
        t = a.type
        while c.peek() == "," and c.tokens[c.at + 1].isdigit():
            c.next()
            indices.append(int(c.next()))
            t = t.elems[0 if t.kind == "array" else indices[-1]]
        i = Instr("extractvalue", t, [a])
        i.extra["indices"] = indices
        return i

    def _insertvalue(self, c: Cursor) -> Instr:
        a = self.typed(c)
        c.expect(",")
        i = Instr("insertvalue", a.type, [a, self.typed(c)])
        indices = []
        while c.peek() == "," and c.tokens[c.at + 1].isdigit():
            c.next()
            indices.append(int(c.next()))
        i.extra["indices"] = indices
        return i

    def _va_arg(self, c: Cursor) -> Instr:
        a = self.typed(c)
        c.expect(",")
        return Instr("va_arg", self.type(c), [a])

    def _atomicrmw(self, c: Cursor) -> Instr:
        volatile = c.accept("volatile")
        kind = c.next()
        p = self.typed(c)
        c.expect(",")
        v = self.typed(c)
        i = Instr("atomicrmw", v.type, [p, v])
        i.extra["kind"] = kind
        i.volatile = volatile
        self._ordering(c, i)
        return i

    def _cmpxchg(self, c: Cursor) -> Instr:
        c.accept("weak")
        volatile = c.accept("volatile")
        p = self.typed(c)
        c.expect(",")
        old = self.typed(c)
        c.expect(",")
        new = self.typed(c)
        i = Instr("cmpxchg", Type("struct", 0, (old.type, I1)), [p, old, new])
        i.volatile = volatile
        self._ordering(c, i)
        return i

    def _fence(self, c: Cursor) -> Instr:
        i = Instr("fence", VOID, [])
        self._ordering(c, i)
        return i

    def _call(self, c: Cursor) -> Instr:
        self._flags(c)
        while c.peek() in IGNORED_WORDS:
            c.next()
        self._attrs(c)
        t = self._type1(c)
        vararg, fixed = False, -1
        if c.peek() == "(":  # full function type, printed for variadic callees
            c.next()
            fixed = 0
            while not c.accept(")"):
                if c.accept("..."):
                    vararg = True
                else:
                    self._type1(c)
                    fixed += 1
                c.accept(",")
        callee = self.value(c, PTR)
        c.expect("(")
        args: list[Value] = []
        attrs: list[dict[str, object]] = []
        while not c.accept(")"):
            at = self._type1(c)
            if at.kind == "meta":
                args.append(self._meta_arg(c))
                attrs.append({})
            else:
                attrs.append(self._attrs(c))
                args.append(self.value(c, at))
            c.accept(",")
        i = Instr("call", t, [*args, callee])
        i.extra["attrs"] = attrs
        i.extra["vararg"] = vararg
        i.extra["fixed"] = fixed
        flags = set()
        while c.peek() not in ("", ","):
            word = c.next()
            if word == "[":
                raise c.error("operand bundle on a call")
            if c.peek() == "(":
                c.skip_parens()
            flags.add(word)
        i.extra["flags"] = flags
        return i

    def _meta_arg(self, c: Cursor) -> Value:
        if c.peek().startswith("!"):
            token = c.next()
            if c.peek() == "(":
                c.skip_parens()
            elif token == "!":
                token = c.next()
            return MetaRef(token)
        return self.typed(c)


PARAM_WORDS = {
    "noundef", "signext", "zeroext", "inreg", "noalias", "nocapture", "nofree", "nest", "returned", "nonnull", "readonly",
    "readnone", "writeonly", "immarg", "swiftself", "noext", "writable", "dead_on_unwind", "allocptr", "dead_on_return",
}  # fmt: skip

INSTRS: dict[str, Callable[[Reader, Cursor], Instr]] = {
    "load": Reader._load,
    "store": Reader._store,
    "alloca": Reader._alloca,
    "getelementptr": Reader._gep,
    "icmp": Reader._compare,
    "fcmp": Reader._compare,
    "select": Reader._select,
    "phi": Reader._phi,
    "br": Reader._br,
    "switch": Reader._switch,
    "indirectbr": Reader._indirectbr,
    "ret": Reader._ret,
    "unreachable": Reader._plain,
    "freeze": Reader._unary,
    "fneg": Reader._unary,
    "extractvalue": Reader._extractvalue,
    "insertvalue": Reader._insertvalue,
    "extractelement": Reader._lane,
    "insertelement": Reader._lane,
    "shufflevector": Reader._lane,
    "va_arg": Reader._va_arg,
    "atomicrmw": Reader._atomicrmw,
    "cmpxchg": Reader._cmpxchg,
    "fence": Reader._fence,
    "call": Reader._call,
}


def _narrow(bits64: int) -> int:
    """Bits of the float whose value the 64-bit pattern holds exactly (LLVM prints floats as doubles)."""
    value = struct.unpack("<d", bits64.to_bytes(8, "little"))[0]
    if value != value:  # NaN: keep sign and the top of the payload
        return (bits64 >> 63) << 31 | 0x7F800000 | ((bits64 >> 29) & 0x7FFFFF)
    return int.from_bytes(struct.pack("<f", value), "little")


def _fold_gep(c: Cursor, source: Type, args: list[Value]) -> Value:
    """Constant getelementptr: base plus a number of bytes."""
    base, offset, t = args[0], 0, source
    for k, index in enumerate(args[1:]):
        if not isinstance(index, ConstInt):
            raise c.error("constant getelementptr with a symbolic index")
        if k == 0:
            offset += index.signed * size_of(t)
        elif t.kind == "struct":
            offset += struct_offsets(t)[index.value]
            t = t.elems[index.value]
        else:
            t = t.elems[0]
            offset += index.signed * size_of(t)
    if isinstance(base, GlobalRef):
        return GlobalRef(base.name, base.offset + offset)
    if isinstance(base, ConstInt):
        return ConstInt(PTR, base.value + offset)
    return ConstExpr(PTR, "add", [base, ConstInt(PTR, offset)])


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


def read_module(text: str) -> Module:
    """Parse LLVM IR text. Raises UnsupportedError naming the line of the text."""
    return Reader(text).read()
