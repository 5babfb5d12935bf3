"""Parser of instructions: one handler per opcode, in the table INSTRS."""

from __future__ import annotations

from collections.abc import Callable

from .lex import BINARY, CASTS, IGNORED_WORDS, OPERATION_FLAGS, Cursor, name_of
from .model import (
    I1,
    PTR,
    VOID,
    ConstInt,
    GlobalRef,
    Instr,
    MetaRef,
    ParameterAttributes,
    Type,
    Value,
)
from .read_values import ValueReader


class InstrReader(ValueReader):
    """Parser of one instruction per line."""

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
        while c.peek() in OPERATION_FLAGS:
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
        """Parse `type value, type value...` up to the metadata attachments."""
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
        if c.peek() == "(":  # parameter types of the callee, which LLVM prints for variadic functions
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
        attrs: list[ParameterAttributes] = []
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
                self._assumption(c, callee)
                continue
            if c.peek() == "(":
                c.skip_parens()
            flags.add(word)
        i.extra["flags"] = flags
        return i

    def _assumption(self, c: Cursor, callee: Value) -> None:
        """Skip an operand bundle of llvm.assume, such as `"align"(ptr %p, i16 8)`; others raise UnsupportedError."""
        if not (isinstance(callee, GlobalRef) and callee.name == "llvm.assume"):
            raise c.error("operand bundle on a call")
        while not c.accept("]"):
            c.next()
            c.skip_parens()
            c.accept(",")

    def _meta_arg(self, c: Cursor) -> Value:
        if c.peek().startswith("!"):
            token = c.next()
            if c.peek() == "(":
                c.skip_parens()
            elif token == "!":
                token = c.next()
            return MetaRef(token)
        return self.typed(c)


INSTRS: dict[str, Callable[[InstrReader, Cursor], Instr]] = {
    "load": InstrReader._load,
    "store": InstrReader._store,
    "alloca": InstrReader._alloca,
    "getelementptr": InstrReader._gep,
    "icmp": InstrReader._compare,
    "fcmp": InstrReader._compare,
    "select": InstrReader._select,
    "phi": InstrReader._phi,
    "br": InstrReader._br,
    "switch": InstrReader._switch,
    "indirectbr": InstrReader._indirectbr,
    "ret": InstrReader._ret,
    "unreachable": InstrReader._plain,
    "freeze": InstrReader._unary,
    "fneg": InstrReader._unary,
    "extractvalue": InstrReader._extractvalue,
    "insertvalue": InstrReader._insertvalue,
    "extractelement": InstrReader._lane,
    "insertelement": InstrReader._lane,
    "shufflevector": InstrReader._lane,
    "va_arg": InstrReader._va_arg,
    "atomicrmw": InstrReader._atomicrmw,
    "cmpxchg": InstrReader._cmpxchg,
    "fence": InstrReader._fence,
    "call": InstrReader._call,
}
