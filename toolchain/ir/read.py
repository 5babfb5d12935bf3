"""Parser of LLVM IR text.

It reads the module line by line. A line of a function body is one instruction; a switch extends to its closing bracket.
Text outside the grammar that clang 22 prints for C raises `UnsupportedError` with the line number of the IR text.
"""

from __future__ import annotations

import re

from .lex import IGNORED_WORDS, LINKAGES, Cursor, name_of, strip_comment, unquote
from .model import (
    Arg,
    Block,
    DbgRecord,
    Function,
    GlobalVar,
    Instr,
    Module,
    Type,
    Undef,
    UnsupportedError,
    Value,
)
from .read_instr import InstrReader


class Reader(InstrReader):
    """Parser of one module."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.lines = text.split("\n")
        self.at = 0
        self.module = Module()
        self.attr_groups: dict[str, frozenset[str]] = {}
        self.pending_attrs: list[tuple[Function, list[str]]] = []

    # -- module level -------------------------------------------------------------------------------------------------

    def read(self) -> Module:
        """Parse the whole module."""
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
        """Parse the named struct types, inner types first; in the text a type may refer to a later one."""
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
            self.module.source = unquote(line.split('"')[1]).decode(errors="replace")
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
        self._attrs(c)
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
        flags: set[str] = set()
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
        """Parse the result type of a function; a parenthesis after it starts the parameters."""
        return self._type1(c)

    # -- function bodies ----------------------------------------------------------------------------------------------

    def _define(self, line: str) -> None:
        c = Cursor(strip_comment(line), self.at)
        f, _ = self._signature(c)
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
        self.at += 1
        self._resolve(f)
        self.module.functions[f.name] = f

    def _entry_name(self, f: Function) -> str:
        """Name of an entry block without label: the number that follows those of the unnamed parameters."""
        return str(sum(1 for a in f.args if a.name.isdigit()))

    def _line(self, block: Block, text: str) -> None:
        n = self.at
        if text.startswith("  switch") or " switch " in text[:10]:
            while "]" not in text:
                text += " " + self.lines[self.at]
                self.at += 1
        if "callbr" in text.split("@", 1)[0].split():
            refused = UnsupportedError("asm goto: let the statement set a variable and test that", f"LLVM IR line {n}")
            place = re.search(r"!dbg (!\d+)", text + self.lines[self.at])
            refused.line = place[1] if place is not None else None
            raise refused
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
            elif key == "!DIAssignID":
                instr.extra["assign"] = c.next()
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
        """Replace the placeholders of values that are used before their definition."""
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
            if isinstance(record.address, Instr) and record.address.op == "forward":
                record.address = self.locals.get(record.address.name)

    def _dbg(self, f: Function, block: Block, text: str) -> None:
        kind = text.strip().split("(", 1)[0][1:]
        if kind not in ("dbg_value", "dbg_declare", "dbg_assign"):
            return
        c = Cursor(text.strip()[len(kind) + 2 :], self.at)
        value = self._debug_value(c)
        c.expect(",")
        record = DbgRecord(kind, value, c.next(), "", block.name, len(block.instrs))
        c.expect(",")
        c.next()
        record.expression = " ".join(c.skip_parens())
        c.expect(",")
        if kind == "dbg_assign":
            record.link = c.next()
            c.expect(",")
            record.address = self._debug_value(c)
            c.expect(",")
            c.next()
            c.skip_parens()
            c.expect(",")
        record.location = c.next()
        f.dbg_records.append(record)

    def _debug_value(self, c: Cursor) -> Value | None:
        """Parse the value of a debug record; return None for a list of values (DIArgList) and for a removed value."""
        if c.peek().startswith("!"):
            c.next()
            if c.peek() == "(":
                c.skip_parens()
            return None
        value = self.typed(c)
        return None if isinstance(value, Undef) else value


def read_module(text: str) -> Module:
    """Parse LLVM IR text. Raise UnsupportedError with the number of the unsupported line."""
    return Reader(text).read()
