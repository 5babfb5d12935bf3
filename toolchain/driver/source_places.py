"""Places in the C source for errors that the assembler and the linker find, which see neither lines nor functions.

Only after such an error: the sources go through the front end once more, with debug information. Enters: the error and
what the driver can do. Leaves: the error with "file.c:12" in front of what it says.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from toolchain.errors import ToolError

_UNDEFINED = re.compile(r"error: undefined symbol (\S+), referenced at ")
_REFUSED = re.compile(r"not supported: (?:LLVM IR line|in function|in variable|function) ")
_HANDLER = re.compile(r"error: (interrupt )?function '")
_FUNCTION = re.compile(r'^define .*?@("[^"]+"|[\w$.]+)\(')
_NAME = re.compile(r'@("[^"]+"|[\w$.]+)')
_LOCATION = re.compile(r"!dbg (!\d+)")
MOST_PLACES = 3  # shown of one symbol


def concerns_generated_code(error: ToolError) -> bool:
    """Whether debug information could tell more: an assembler's message, a symbol that nobody defines, what the back
    end does not do, or a handler's wrong name."""
    return any(
        re.match(r"[^:\n]+: error: ", line) or _UNDEFINED.search(line) or _REFUSED.search(line) or _HANDLER.match(line)
        for line in error.findings
    )


def with_places(error: ToolError, modules: Callable[[], Iterable[str]]) -> ToolError:
    """`error` with the source lines that use its undefined symbols; `modules` gives IR text with debug information."""
    if not any(_UNDEFINED.search(line) for line in error.findings):
        return error
    uses: dict[str, list[str]] = {}
    for text in modules():
        for symbol, place in _uses(text):
            places = uses.setdefault(symbol, [])
            if place not in places:
                places.append(place)
    findings: list[str] = []
    for line in error.findings:
        found = _UNDEFINED.search(line)
        places = uses.get(found[1], []) if found else []
        if found is None or not places:
            findings.append(line)
            continue
        findings += [f"{place.split(' ')[0]}: error: undefined symbol {found[1]}, {place.split(' ', 1)[1]}"
                     for place in places[:MOST_PLACES]]  # fmt: skip
    return ToolError.of(findings)


def _uses(text: str) -> Iterable[tuple[str, str]]:
    """(assembler name, "file:line used in function 'f'") of every reference in the code of one module."""
    from toolchain.debuginfo.metadata import DebugInfo
    from toolchain.ir.read import read_module

    info = DebugInfo(read_module(text))
    function = ""
    for line in text.splitlines():
        if start := _FUNCTION.match(line):
            function = start[1].strip('"')
        elif (location := _LOCATION.search(line)) and (position := info.position(location[1])):
            for name in _NAME.findall(line):
                plain = name.strip('"')
                symbol = plain[3:] if plain.startswith("\\01") else f"_{plain}"
                yield symbol, f"{position[0]}:{position[1]} used in function '{function}'"
