"""Lexer of LLVM IR text: tokens, and a cursor over the tokens of one logical line."""

from __future__ import annotations

import re

from .model import UnsupportedError

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
OPERATION_FLAGS = {"nuw", "nsw", "exact", "disjoint", "nneg", "inbounds", "nusw", "samesign", "fast", "nnan", "ninf",
                   "nsz", "arcp", "contract", "afn", "reassoc"}  # fmt: skip
BINARY = {
    "add", "sub", "mul", "udiv", "sdiv", "urem", "srem", "and", "or", "xor", "shl", "lshr", "ashr", "fadd", "fsub",
    "fmul", "fdiv", "frem",
}  # fmt: skip
CASTS = {
    "trunc", "zext", "sext", "fptrunc", "fpext", "fptoui", "fptosi", "uitofp", "sitofp", "ptrtoint", "inttoptr",
    "bitcast", "addrspacecast", "ptrtoaddr",
}  # fmt: skip
TYPED_ATTRS = {"byval", "sret", "byref", "inalloca", "preallocated", "elementtype"}
UNALIGNED_RUN = '"unaligned-run"'  # string attribute that abi.struct_alignment sets
PAREN_ATTRS = {"dereferenceable", "dereferenceable_or_null", "captures", "initializes", "range", "memory", "nofpclass",
               "allocsize", "vscale_range"}  # fmt: skip


def unquote(text: str) -> bytes:
    """Bytes of an LLVM string body; \\XX is the byte with that hexadecimal value."""
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
    """Cursor over the tokens of one logical line."""

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
    """Identifier in a token such as %x, @x or %"x"."""
    body = token[1:]
    return unquote(body[1:-1]).decode("latin-1") if body.startswith('"') else body


PARAM_WORDS = {
    "noundef", "signext", "zeroext", "inreg", "noalias", "nocapture", "nofree", "nest", "returned", "nonnull",
    "readonly",
    "readnone", "writeonly", "immarg", "swiftself", "noext", "writable", "dead_on_unwind", "allocptr", "dead_on_return",
    "allocalign",
}  # fmt: skip
