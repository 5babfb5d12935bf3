"""Annotations in the section .note.bounds (include/bounds.h), and values for the names in their expressions."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from toolchain.elf.model import Executable
from toolchain.errors import ToolError

SECTION = ".note.bounds"
_LINE = re.compile(r"(\w+) (.*)@(.+):(\d+)")
_FUNCTION = re.compile(r"in (\w+)")
"""Pattern of the enclosing function, which the compiler writes after an annotation (toolchain/emit)."""
AT = ("loop", "total", "share", "one", "same", "calls", "often", "if")
"""Kinds of annotations within BOUNDS_AT."""
_OF_A_FILE = re.compile(r"(\.\w+) ?/ ?(?=\w)")
"""Pattern of `file.c/name`, with the blanks that C formatters insert as in a division."""
_OPERATORS: dict[type[ast.operator], Callable[[int, int], int]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.floordiv,
    ast.FloorDiv: operator.floordiv,
}


@dataclass(frozen=True, slots=True)
class Annotation:
    """One annotation: kind (loop, calls, argument, back, private, ram ...), text and source position."""

    kind: str
    text: str
    file: str
    line: int
    function: str = ""
    """The enclosing function, "" if the compiler recorded none."""

    @property
    def place(self) -> str:
        """Return file and line, for messages."""
        return f"{self.file}:{self.line}"


@dataclass(slots=True)
class AnnotationSet:
    """All annotations of an image, and the values of the names in them."""

    all: list[Annotation] = field(default_factory=list)
    values: Mapping[str, int] = field(default_factory=dict)
    missing: set[str] = field(default_factory=set)
    """Names that an evaluated expression contains and that have no value."""

    def of(self, kind: str) -> list[Annotation]:
        """Return the annotations of one kind."""
        return [annotation for annotation in self.all if annotation.kind == kind]

    def number(self, text: str, where: Annotation) -> int | None:
        """Return the value of an expression, None if a name has no value; raises `ToolError` if it cannot be parsed."""
        try:
            tree = ast.parse(text.strip(), mode="eval").body
        except SyntaxError:
            raise ToolError(f"{where.place}: expected a number or an expression, got {text!r}") from None
        return self._value(tree, where)

    def _value(self, tree: ast.expr, where: Annotation) -> int | None:
        match tree:
            case ast.Constant(value=int(value)):
                return value
            case ast.Name(id=name):
                if name not in self.values:
                    self.missing.add(name)
                return self.values.get(name)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                a, b = self._value(left, where), self._value(right, where)
                return None if a is None or b is None else _OPERATORS[type(op)](a, b)
            case ast.Call(func=ast.Name(id="min"), args=[_, *_] as parts, keywords=[]):
                missing = set(self.missing)
                known = [number for part in parts if (number := self._value(part, where)) is not None]
                if known:
                    self.missing = missing
                return min(known, default=None)
        raise ToolError(f"{where.place}: expected integers, names, + - * / min, got {ast.unparse(tree)!r}")


def read_annotation_section(image: Executable, values: Mapping[str, int]) -> AnnotationSet:
    """Return the annotations of an image; raises `ToolError` for a line that cannot be parsed."""
    result = AnnotationSet(values=values)
    for section in image.sections:
        if section.name == SECTION:
            for line in bytes(section.data[::2]).replace(b"\0", b"").decode("utf-8", "replace").splitlines():
                inside = _FUNCTION.fullmatch(line)
                if inside is not None and result.all:
                    result.all[-1] = replace(result.all[-1], function=inside[1])
                    continue
                match = _LINE.fullmatch(line)
                if match is None:
                    raise ToolError(f"section {SECTION}: expected `kind text@file:line`, got {line!r}")
                text = _OF_A_FILE.sub(r"\1/", match[2].strip())
                parts = [part.partition(" ") for part in _parts(text)] if match[1] == "at" else [(match[1], "", text)]
                result.all += [Annotation(kind, rest.strip(), match[3], int(match[4])) for kind, _, rest in parts]
                wrong = next(
                    (one for one in result.all[-len(parts) :] if match[1] == "at" and one.kind not in AT), None
                )
                if wrong is not None:
                    raise ToolError(f"{wrong.place}: expected one of {', '.join(AT)}, got {wrong.kind!r}")
    return result


def _parts(text: str) -> list[str]:
    """Split the text of BOUNDS_AT at commas outside parentheses; remove the parentheses around a list of targets."""
    parts, depth = [""], 0
    for character in text:
        depth += (character == "(") - (character == ")")
        if character == "," and not depth:
            parts.append("")
        else:
            parts[-1] += character
    return [re.sub(r"^calls\s*\((.*)\)$", r"calls \1", part.strip()) for part in parts]
