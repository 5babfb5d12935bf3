"""Source positions for errors of the assembler and the linker, which know neither lines nor functions.

After such an error, the driver compiles the sources again with debug information, and `with_positions` adds "file.c:12"
to the messages.
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
MAX_POSITIONS = 3  # maximum number of positions shown per symbol


def concerns_generated_code(error: ToolError) -> bool:
    """Whether debug information adds positions to an error, one of assembler, back end, linker or handler names."""
    return any(
        re.match(r"[^:\n]+: error: ", line) or _UNDEFINED.search(line) or _REFUSED.search(line) or _HANDLER.match(line)
        for line in error.findings
    )


def with_positions(error: ToolError, modules: Callable[[], Iterable[str]]) -> ToolError:
    """`error` with the source lines that use undefined symbols; `modules` returns IR text with debug information."""
    if not any(_UNDEFINED.search(line) for line in error.findings):
        return error
    uses: dict[str, list[str]] = {}
    for text in modules():
        for symbol, position in _uses(text):
            positions = uses.setdefault(symbol, [])
            if position not in positions:
                positions.append(position)
    findings: list[str] = []
    for line in error.findings:
        found = _UNDEFINED.search(line)
        positions = uses.get(found[1], []) if found else []
        if found is None or not positions:
            findings.append(line)
            continue
        findings += [f"{position.split(' ')[0]}: error: undefined symbol {found[1]}, {position.split(' ', 1)[1]}"
                     for position in positions[:MAX_POSITIONS]]  # fmt: skip
    return ToolError.of(findings)


def _uses(text: str) -> Iterable[tuple[str, str]]:
    """(assembler name, "file:line used in function 'f'") of every reference in the code of a module."""
    from toolchain.debuginfo.metadata import DebugMetadata
    from toolchain.ir.read import read_module

    info = DebugMetadata(read_module(text))
    function = ""
    for line in text.splitlines():
        if start := _FUNCTION.match(line):
            function = start[1].strip('"')
        elif (location := _LOCATION.search(line)) and (position := info.position(location[1])):
            for name in _NAME.findall(line):
                plain = name.strip('"')
                symbol = plain[3:] if plain.startswith("\\01") else f"_{plain}"
                yield symbol, f"{position[0]}:{position[1]} used in function '{function}'"
