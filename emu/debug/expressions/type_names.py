"""Type names of casts and `sizeof` (C11 §6.7.7): `unsigned char`, `struct node *`, `int (*)[3]`.

Inputs: tokens of an expression, and a function that finds the program's types. Output: a `Type`. Sizes are the chip's
(int 16, long 32, pointers 16 bits). Base types of the program take precedence, for example its `double`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from emu.debug.dwarf.types import TAGGED, VOID, Type

Find = Callable[[str], Type | None]
"""Function that finds a type of the program by name: `node` is a typedef or a base type, `struct node` a tag."""
QUALIFIERS: Final = ("const", "volatile", "restrict", "register")
POINTER: Final = 2
"""Size of a pointer in bytes."""
_INTEGER_SIZES: Final = {("char",): 1, (): 2, ("short",): 2, ("long",): 4, ("long", "long"): 8}
"""Size in bytes of each integer type, by its keywords other than `int`, `signed` and `unsigned`."""
_OTHERS: Final = {
    ("float",): Type("float", "float", 4),
    ("double",): Type("float", "double", 8),
    ("double", "long"): Type("float", "long double", 8),
    ("_Bool",): Type("bool", "_Bool", 1),
    ("void",): VOID,
}
_WORDS: Final = frozenset(word for words in (*_INTEGER_SIZES, *_OTHERS) for word in words) | {
    "int",
    "signed",
    "unsigned",
}
_LIBRARY: Final = {
    **{f"int{8 * size}_t": Type("signed", f"int{8 * size}_t", size, is_signed=True) for size in (2, 4, 8)},
    **{f"uint{8 * size}_t": Type("unsigned", f"uint{8 * size}_t", size) for size in (2, 4, 8)},
    "int8_t": Type("char", "int8_t", 1, is_signed=True),
    "uint8_t": Type("char", "uint8_t", 1),
    "size_t": Type("unsigned", "size_t", POINTER),
    "uintptr_t": Type("unsigned", "uintptr_t", POINTER),
    "intptr_t": Type("signed", "intptr_t", POINTER, is_signed=True),
    "ptrdiff_t": Type("signed", "ptrdiff_t", POINTER, is_signed=True),
    "bool": Type("bool", "bool", 1),
}
"""Types of the C library. The debug information of a program lacks them if the program does not use them."""


class TypeNameError(ValueError):
    """The tokens begin like a type name but do not name a type."""


def type_name(tokens: Sequence[tuple[str, str]], at: int, find: Find) -> tuple[Type, int] | None:
    """Return the type named by the tokens from index `at`, and the index after it; None if they begin otherwise.

    Raises TypeNameError.
    """
    reader = _Reader(tokens, at, find)
    kind = reader.specifiers()
    return (reader.declarator(kind), reader.at) if kind is not None else None


class _Reader:
    def __init__(self, tokens: Sequence[tuple[str, str]], at: int, find: Find) -> None:
        self.tokens: Final = tokens
        self.at = at
        self.find: Final = find

    def _next(self) -> tuple[str, str]:
        return self.tokens[self.at] if self.at < len(self.tokens) else ("", "")

    def _accept(self, *texts: str) -> str:
        """Consume and return the next token's text if it is one of `texts`; else return ""."""
        text = self._next()[1] if self._next()[0] in ("name", "sign") else ""
        if text not in texts or not text:
            return ""
        self.at += 1
        return text

    def specifiers(self) -> Type | None:
        """Parse the type specifiers and qualifiers before the declarator."""
        words: list[str] = []
        named: Type | None = None
        while self._next()[0] == "name":
            word = self._next()[1]
            if self._accept(*QUALIFIERS):
                continue
            if word in TAGGED and named is None and not words:
                named = self._tagged(word)
            elif word in _WORDS and named is None:
                self.at += 1
                words.append(word)
            elif named is None and not words and (found := self.find(word) or _LIBRARY.get(word)) is not None:
                self.at += 1
                named = found
            else:
                break
        return named if not words else self._basic(words)

    def _tagged(self, word: str) -> Type:
        self.at += 1
        kind, name = self._next()
        if kind != "name":
            raise TypeNameError(f"expected a name behind {word!r}")
        self.at += 1
        found = self.find(f"{word} {name}")
        if found is None:
            raise TypeNameError(f"there is nothing called '{word} {name}' here")
        return found

    def _basic(self, words: list[str]) -> Type:
        is_unsigned, is_signed = words.count("unsigned"), words.count("signed")
        rest = tuple(sorted(word for word in words if word not in ("unsigned", "signed", "int")))
        text = " ".join(words)
        if rest in _OTHERS and len(rest) == len(words):
            return self.find(" ".join(reversed(rest))) or _OTHERS[rest]
        if rest not in _INTEGER_SIZES or words.count("int") + (rest == ("char",)) > 1 or is_unsigned + is_signed > 1:
            raise TypeNameError(f"{text!r} is no type")
        size = _INTEGER_SIZES[rest]
        if size == 1:
            char = self.find("char") if not is_unsigned + is_signed else None
            return char or Type("char", text, size, is_signed=not is_unsigned)
        return Type("unsigned" if is_unsigned else "signed", text, size, is_signed=not is_unsigned)

    def declarator(self, kind: Type) -> Type:
        """Parse the abstract declarator: stars, array bounds, and a parenthesised inner declarator as in `(*)[3]`."""
        while self._accept("*"):
            kind = Type("pointer", size=POINTER, target=kind)
            while self._accept(*QUALIFIERS):
                pass
        inner: int | None = None
        if self._next()[1] == "(" and self.at + 1 < len(self.tokens) and self.tokens[self.at + 1][1] == "*":
            inner = self.at + 1
            self._skip()
        counts = []
        while self._accept("["):
            counts.append(self._count())
        for count in reversed(counts):
            kind = Type("array", target=kind, count=count)
        if inner is None:
            return kind
        if self._next()[1] == "(":
            self._skip()
            kind = Type("function", target=kind)
        within = _Reader(self.tokens, inner, self.find)
        kind = within.declarator(kind)
        if within._next()[1] != ")":
            raise TypeNameError("expected ')' in the name of a type")
        return kind

    def _skip(self) -> None:
        """Skip a parenthesised group."""
        depth = 0
        while self.at < len(self.tokens):
            text = self.tokens[self.at][1] if self.tokens[self.at][0] == "sign" else ""
            depth += (text == "(") - (text == ")")
            self.at += 1
            if not depth:
                return
        raise TypeNameError("expected ')' in the name of a type")

    def _count(self) -> int:
        kind, text = self._next()
        if kind != "number" or not text.isdecimal() or not 0 < int(text) < 1 << 16:
            raise TypeNameError("expected a number of elements, 1 to 65535")
        self.at += 1
        if not self._accept("]"):
            raise TypeNameError("expected ']' in the name of a type")
        return int(text)
