"""Refuses misuse of interrupt handler names: the linker binds them to vectors by name alone (abi-elf.md §2.7).

Enters: IR text. A function with a vector's name must be an interrupt function, and an interrupt function must bear one.
"""

from __future__ import annotations

import re

from emu.chips.dspic30f6014a import VECTORS
from toolchain.errors import ToolError

VECTOR_FUNCTIONS = frozenset(
    ["_DefaultInterrupt", *(prefix + vector.name for vector in VECTORS for prefix in ("_", "_Alt"))]
)
"""C names that the linker puts into the vector tables."""

_DEFINITION = re.compile(r'^define [^@\n]*@("[^"]+"|[\w$.]+)\(', re.MULTILINE)
_ANNOTATIONS = re.compile(r"^@llvm\.global\.annotations = .*$", re.MULTILINE)
_ANNOTATED = re.compile(r"\{ ptr @([\w$.]+), ptr (@[\w$.]+),")
_STRING = re.compile(r'^(@[\w$.]+) = [^\n]*c"interrupt\\00"', re.MULTILINE)


def check(ir_text: str) -> None:
    """Raise `ToolError` listing every handler whose name and kind disagree."""
    marks = set(_STRING.findall(ir_text))
    annotations = _ANNOTATIONS.search(ir_text)
    pairs = _ANNOTATED.findall(annotations[0]) if annotations else []
    handlers = {function for function, mark in pairs if mark in marks}
    defined = {name.strip('"') for name in _DEFINITION.findall(ir_text)}
    findings = [
        f"error: function '{name}' has the name of an interrupt vector but is not an interrupt function "
        f"(define it with OS_ISR({name}))"
        for name in sorted((defined & VECTOR_FUNCTIONS) - handlers)
    ]
    findings += [
        f"error: interrupt function '{name}' does not have a vector's name, so nothing would call it "
        f"(names look like {_nearest(name)})"
        for name in sorted((defined & handlers) - VECTOR_FUNCTIONS)
    ]
    if findings:
        raise ToolError.of(findings)


def _nearest(name: str) -> str:
    import difflib

    close = difflib.get_close_matches(name, sorted(VECTOR_FUNCTIONS), 1)
    return close[0] if close else "_T1Interrupt"
