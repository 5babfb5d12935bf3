"""Source positions for errors of the assembler and the linker, which know neither lines nor functions.

After such an error, the driver compiles the sources again with debug information, and `with_positions` adds "file.c:12"
to the messages.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from toolchain.errors import ToolError

_DUPLICATE = re.compile(r"error: duplicate symbol '?_?([\w$]+)'?[:,] defined in")
_IN_SECTION = re.compile(r"(?:error: )?[^:\s]+:\(\.[\w.$]*?\._(\w+)(?:\+0x[0-9a-f]+)?\)")
_UNDEFINED = re.compile(r"error: undefined symbol (\S+), referenced at [^;]*(;.*)?")
_REFUSED = re.compile(r"not supported: (?:LLVM IR line|in function|in variable|function) ")
_HANDLER = re.compile(r"error: (?:interrupt )?function '")
_FUNCTION = re.compile(r'^define .*?@("[^"]+"|[\w$.]+)\(')
_NAME = re.compile(r'@("[^"]+"|[\w$.]+)')
_LOCATION = re.compile(r"!dbg (!\d+)")
_ASSEMBLY = re.compile(r'\basm (?:\w+ )*"([^"]*)"')
"""Text of inline assembly in a line of LLVM IR."""
MAX_POSITIONS = 3  # maximum number of positions shown per symbol


def concerns_generated_code(error: ToolError) -> bool:
    """Whether debug information can add positions to an error of assembler, back end, linker or handler check."""
    return any(
        re.match(r"[^:\n]+: error: ", line)
        or _DUPLICATE.search(line)
        or _IN_SECTION.match(line)
        or _UNDEFINED.search(line)
        or _REFUSED.search(line)
        or _HANDLER.match(line)
        for line in error.findings
    )


def with_positions(error: ToolError, modules: Callable[[], Iterable[str]]) -> ToolError:
    """`error` with source lines: of uses of undefined symbols, of duplicate definitions, of objects in sections.

    `modules` returns IR text with debug information.
    """
    patterns = (_UNDEFINED, _DUPLICATE, _IN_SECTION)
    if not any(pattern.search(line) for line in error.findings for pattern in patterns):
        return error
    uses: dict[str, list[str]] = {}
    definitions: dict[str, list[str]] = {}
    for text in modules():
        for symbol, position in _uses(text):
            positions = uses.setdefault(symbol, [])
            if position not in positions:
                positions.append(position)
        for name, position in _definitions(text):
            definitions.setdefault(name, []).append(position)
    return ToolError.of([line for finding in error.findings for line in _located(finding, uses, definitions)])


def _located(finding: str, uses: dict[str, list[str]], definitions: dict[str, list[str]]) -> list[str]:
    """Return the message lines of one finding, each with its source position if that is known."""
    if undefined := _UNDEFINED.search(finding):
        cure = undefined[2] or ""
        return [f"{position.split(' ')[0]}: error: undefined symbol {undefined[1]}, {position.split(' ', 1)[1]}{cure}"
                for position in uses.get(undefined[1], [])[:MAX_POSITIONS]] or [finding]  # fmt: skip
    if duplicate := _DUPLICATE.search(finding):
        first, *others = definitions.get(duplicate[1], [""])
        return [f"{other}: error: duplicate symbol '{duplicate[1]}': first defined at {first}; "
                "make one of them static, or remove it" for other in others] or [finding]  # fmt: skip
    if (place := _IN_SECTION.match(finding)) and definitions.get(place[1]):
        return [f"{definitions[place[1]][0]}: error: {finding.removeprefix('error: ').replace(': error: ', ': ', 1)}"]
    return [finding]


def _definitions(text: str) -> Iterable[tuple[str, str]]:
    """(C name, "file:line") of every function and variable that a module defines."""
    from toolchain.debuginfo.metadata import DebugMetadata
    from toolchain.ir.read import read_module

    module = read_module(text)
    info = DebugMetadata(module)
    defined = [(f.name, f.dbg) for f in module.functions.values() if f.blocks]
    defined += [(v.name, v.dbg) for v in module.globals.values() if v.init is not None]
    for name, reference in defined:
        if position := info.declared(reference):
            yield name, f"{position[0]}:{position[1]}"


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
            words = {word for text in _ASSEMBLY.findall(line) for word in re.findall(r"[A-Za-z_]\w*", text)}
            yield from ((word, f"{position[0]}:{position[1]} used in function '{function}'") for word in words)
            for name in _NAME.findall(line):
                plain = name.strip('"')
                symbol = plain[3:] if plain.startswith("\\01") else f"_{plain}"
                yield symbol, f"{position[0]}:{position[1]} used in function '{function}'"
