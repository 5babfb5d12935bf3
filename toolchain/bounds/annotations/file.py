"""Annotation file: targets of pointer calls, stack and recursion bounds, thread entries, for code without bounds.h.

A text file, one statement per line, `#` starts a comment:

    calls FUNCTION: TARGET, TARGET ...   pointer calls inside FUNCTION reach one of these; * is every
                                         function whose address the program takes
    depth FUNCTION BYTES                 FUNCTION and its callees use at most BYTES; they are not analysed
    recursion FUNCTION COUNT             at most COUNT activations of FUNCTION exist at once
    thread FUNCTION                      FUNCTION is the entry of a thread

The firmware may contain the same facts as absolute global symbols: `__stack_depth_of_FUNCTION`,
`__stack_recursion_of_FUNCTION` (their value is the number) and `__stack_thread_FUNCTION`.
Names are as in C or as in assembly.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from toolchain.elf.model import Home, Symbol
from toolchain.errors import SourceLocation, ToolError

_LINE = re.compile(r"(calls|depth|recursion|thread)\s+([\w.$]+)\s*:?\s*(.*)")
_SYMBOL = re.compile(r"__stack_(depth_of|recursion_of|thread)_(.+)")


@dataclass(slots=True)
class FileAnnotations:
    """Annotations by function name as written."""

    calls: dict[str, list[str]] = field(default_factory=dict)
    depth: dict[str, int] = field(default_factory=dict)
    recursion: dict[str, int] = field(default_factory=dict)
    threads: list[str] = field(default_factory=list)
    any_handle: bool = False
    """Whether pointer calls without known targets may reach every function whose address is taken."""


def read_annotation_file(text: str, file: str) -> FileAnnotations:
    """Return the annotations in `text`; raise `ToolError` with file and line for a line that cannot be parsed."""
    result = FileAnnotations()
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.partition("#")[0].strip()
        if not line:
            continue
        match = _LINE.fullmatch(line)
        if match is None:
            raise ToolError(
                f"expected calls, depth, recursion or thread and a function, got {line!r}", SourceLocation(file, number)
            )
        kind, name, rest = match.groups()
        if kind == "calls":
            result.calls.setdefault(name, []).extend(t.strip() for t in rest.split(",") if t.strip())
        elif kind == "thread":
            result.threads.append(name)
        else:
            try:
                value = int(rest, 0)
            except ValueError:
                raise ToolError(f"{kind} {name} needs a number, got {rest!r}", SourceLocation(file, number)) from None
            (result.depth if kind == "depth" else result.recursion)[name] = value
    return result


def add_symbols(result: FileAnnotations, symbols: Iterable[Symbol]) -> None:
    """Add the annotations in absolute symbols of the image; those of the file take precedence."""
    for symbol in symbols:
        match = _SYMBOL.fullmatch(symbol.name) if symbol.home is Home.ABSOLUTE else None
        if match is None:
            continue
        if match[1] == "thread":
            result.threads.append(match[2])
        else:
            (result.depth if match[1] == "depth_of" else result.recursion).setdefault(match[2], symbol.value)
