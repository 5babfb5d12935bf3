"""Directives that consume the following lines or another file: macros, repeats, includes (abi-elf.md §4.3)."""

from __future__ import annotations

import os
import re
from collections.abc import Callable

from toolchain.asm.device import include_text, is_device_file
from toolchain.asm.directives.data import file_argument
from toolchain.asm.expr import ExprError
from toolchain.asm.macro import (
    CLOSE_MACRO,
    CLOSE_REPEAT,
    OPEN_MACRO,
    OPEN_REPEAT,
    Macro,
    parse_head,
    split_arguments,
    substitute,
)
from toolchain.asm.source import SourceError
from toolchain.asm.state import Assembler
from toolchain.errors import ToolError
from toolchain.files import read_text

Handler = Callable[[Assembler, str], None]
MAX_REPEAT = 1_000_000  # maximum number of lines that one repeat produces


_NAME = re.compile(r"[A-Za-z_.$][\w.$]*")


def symbol_names(text: str) -> list[str]:
    """Return the symbols of a comma-separated list."""
    names = [n.strip() for n in text.split(",")]
    for name in names:
        if not _NAME.fullmatch(name):
            raise ExprError(f"expected a symbol, got {name!r}")
    return names


def _macro(asm: Assembler, text: str) -> None:
    name, parameters = parse_head(text)
    if name.lower() in asm.macros:
        asm.warn(f"macro {name} has been defined before: this definition replaces that one")
    asm.macros[name.lower()] = Macro(name, parameters, asm.source.block(OPEN_MACRO, CLOSE_MACRO, f".macro {name}"))


def _purge_macro(asm: Assembler, text: str) -> None:
    for name in symbol_names(text):
        if asm.macros.pop(name.lower(), None) is None:
            raise ExprError(f"no macro is called {name}")


def _exit_macro(asm: Assembler, text: str) -> None:
    frame = asm.source.leave_macro()
    if frame is None:
        raise ExprError(".exitm outside a macro")
    asm.conditionals.cut(frame.conditionals)


def _repeat(asm: Assembler, text: str) -> None:
    body = asm.source.block(OPEN_REPEAT, CLOSE_REPEAT, ".rept")
    count = asm.constant(text, ".rept count")
    if not 0 <= count <= MAX_REPEAT:
        raise ExprError(f".rept count {count} is outside 0..{MAX_REPEAT}")
    if count * max(len(body), 1) > MAX_REPEAT:
        raise ExprError(f".rept expands to more than {MAX_REPEAT} lines")
    asm.source.expand(body * count, asm.conditionals.depth)


def _iterate(characters: bool) -> Handler:
    directive = ".irpc" if characters else ".irp"

    def expand(asm: Assembler, text: str) -> None:
        body = asm.source.block(OPEN_REPEAT, CLOSE_REPEAT, directive)
        match = re.match(r"\s*([A-Za-z_$][\w$]*)\s*,?\s*(.*)", text, re.DOTALL)
        if match is None:
            raise ExprError(f"{directive} expects a symbol and values")
        values = list(match[2].strip().strip('"')) if characters else split_arguments(match[2])
        if len(values) * max(len(body), 1) > MAX_REPEAT:
            raise ExprError(f"{directive} expands to more than {MAX_REPEAT} lines")
        lines: list[str] = []
        for value in values or [""]:
            lines += substitute(body, {match[1]: value}, asm.serial)
        asm.source.expand(lines, asm.conditionals.depth)

    return expand


def _stray(directive: str, opener: str) -> Handler:
    def refuse(asm: Assembler, text: str) -> None:
        raise ExprError(f"{directive} without {opener}")

    return refuse


def _include(asm: Assembler, text: str) -> None:
    name = file_argument(text, ".include")
    try:
        path = asm.find_file(name)
    except ExprError:
        if not is_device_file(os.path.basename(name.replace("\\", "/")), asm.options.chip):
            raise
        asm.source.include(include_text(asm.options.chip), name, asm.conditionals.depth)
        return
    try:
        content = read_text(path)
    except ToolError as error:
        raise SourceError(str(error).removeprefix("error: ")) from None
    asm.source.include(content, path, asm.conditionals.depth)


BLOCK_DIRECTIVES: dict[str, Handler] = {
    ".macro": _macro,
    ".endm": _stray(".endm", ".macro"),
    ".exitm": _exit_macro,
    ".purgem": _purge_macro,
    ".rept": _repeat,
    ".irp": _iterate(characters=False),
    ".irpc": _iterate(characters=True),
    ".endr": _stray(".endr", ".rept, .irp or .irpc"),
    ".include": _include,
}
