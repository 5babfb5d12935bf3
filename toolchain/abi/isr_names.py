"""Names of interrupt handlers. The linker binds handlers to vectors by name alone (abi-elf.md §2.7).

`check` refuses functions with a vector's name that are not interrupt functions, interrupt functions without one, and
calls of interrupt functions.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from emu.chips.family import SLOTS
from toolchain.errors import ToolError

VECTOR_FUNCTIONS = frozenset(
    ["_DefaultInterrupt", *(prefix + vector.name for vector in SLOTS for prefix in ("_", "_Alt"))]
)
"""C names of interrupt handlers, which the linker stores in the vector tables."""

IRQ_PREFIX = {"irq": "", "altirq": "Alt"}
"""Prefix of a handler's name, by the keyword of `interrupt(irq(N))` or `interrupt(altirq(N))`."""
FIRST_INTERRUPT = 8  # number of the first interrupt vector; lower numbers are traps (abi-elf.md §2.7)


def irq_name(number: int) -> str:
    """Name of the vector of an interrupt number. Raise IndexError if the chip has no such vector."""
    if number < 0:
        raise IndexError(number)
    return SLOTS[number + FIRST_INTERRUPT].name


_DEFINITION = re.compile(r'^define [^@\n]*@("[^"]+"|[\w$.]+)\([^\n]*?(?: !dbg (!\d+))? \{$', re.MULTILINE)
_CALL = re.compile(r'^ .*\bcall void @("[^"]+"|[\w$.]+)\(\)[^\n]*?(?:, !dbg (!\d+))?(?:, ![^\n]*)?$', re.MULTILINE)
_ANNOTATIONS = re.compile(r"^@llvm\.global\.annotations = .*$", re.MULTILINE)
_ANNOTATED = re.compile(r"\{ ptr @([\w$.]+), ptr (@[\w$.]+), ptr @[\w$.]+, i32 \d+, ptr (@[\w$.]+|null) \}")
_STRING = re.compile(r'^(@[\w$.]+) = [^\n]*c"interrupt\\00"', re.MULTILINE)
_NUMBERED = re.compile(r'^(@[\w$.]+) = [^\n]*c"(?:irq|altirq)\\00"', re.MULTILINE)
_ARGUMENT = re.compile(r"^(@[\w$.]+) = [^\n]* constant \{ i32 \} (?:\{ i32 (-?\d+) \}|zeroinitializer)", re.MULTILINE)


def check(ir_text: str, locate: Callable[[str], str]) -> None:
    """Raise ToolError for handlers whose name and kind disagree, and for calls of handlers.

    `locate` returns "file:line" of metadata.
    """
    marks = set(_STRING.findall(ir_text))
    annotations = _ANNOTATIONS.search(ir_text)
    pairs = _ANNOTATED.findall(annotations[0]) if annotations else []
    handlers = {function for function, mark, _ in pairs if mark in marks}
    numbers, arguments = set(_NUMBERED.findall(ir_text)), dict(_ARGUMENT.findall(ir_text))
    numbered = {function: int(arguments.get(value) or 0) for function, mark, value in pairs if mark in numbers}
    defined_at = {name.strip('"'): ref for name, ref in _DEFINITION.findall(ir_text)}
    defined = set(defined_at)

    def error(name: str) -> str:
        return f"{locate(defined_at[name])}: error" if defined_at.get(name) else "error"

    findings = [
        f"{error(name)}: function '{name}' has the name of an interrupt vector but is not an interrupt function "
        f"(define it with OS_ISR({name}))"
        for name in sorted((defined & VECTOR_FUNCTIONS) - handlers)
    ]
    findings += [
        f"{error(name)}: interrupt function '{name}' does not have a vector's name, so it is never called "
        f"(names look like {_nearest(name)})"
        for name in sorted((defined & handlers) - VECTOR_FUNCTIONS - set(numbered))
    ]
    findings += [
        f"{error(name)}: interrupt function '{name}': irq({number}) is not an interrupt number of this chip "
        f"(expected 0 to {len(SLOTS) - FIRST_INTERRUPT - 1})"
        for name, number in sorted(numbered.items())
        if not _is_irq(number)
    ]
    findings += [
        f"{f'{locate(ref)}: ' if ref else ''}error: interrupt function '{name}' is called: it ends with RETFIE, "
        "which needs the frame of an interrupt; set its interrupt flag, or share a function with it"
        for name, ref in _CALL.findall(ir_text)
        if name.strip('"') in handlers
    ]
    if findings:
        raise ToolError.of(findings)


def _is_irq(number: int) -> bool:
    try:
        return bool(irq_name(number))
    except IndexError:
        return False


def _nearest(name: str) -> str:
    """The vector function with the most similar name."""
    import difflib

    close = difflib.get_close_matches(name, sorted(VECTOR_FUNCTIONS), 1)
    return close[0] if close else "_T1Interrupt"
