"""Main loop of the assembler: reads statements and dispatches them; `finish` creates the object.

The source has the syntax of pic30-as (abi-elf.md §4).
"""

from __future__ import annotations

import re

from toolchain.asm.conditionals import CONDITIONALS
from toolchain.asm.directives.table import DIRECTIVES, rejection, set_symbol
from toolchain.asm.encode import StatementError, assemble_instruction
from toolchain.asm.expr import ExprError
from toolchain.asm.finish import finish
from toolchain.asm.macro import Macro, bind, substitute
from toolchain.asm.source import SourceError
from toolchain.asm.state import Assembler, Options
from toolchain.elf.model import ObjectFile
from toolchain.errors import ToolError

_LABEL = re.compile(r"\s*([A-Za-z_.$][\w.$]*|\d+)\s*:")
_ASSIGN = re.compile(r"\s*([A-Za-z_.$][\w.$]*)\s*=(?!=)\s*(.*)", re.DOTALL)
_STATEMENT = re.compile(r"\s*([A-Za-z_.$][\w.$]*)\s*(.*)", re.DOTALL)


def assemble(text: str, file: str = "<text>", options: Options | None = None) -> tuple[ObjectFile, list[str]]:
    """Assemble `text` to an object; return it and the warnings.  Raise `ToolError` that lists all errors."""
    asm = Assembler(text, file, options or Options())
    _read_all(asm)
    if asm.findings:
        raise ToolError.of(asm.findings)
    obj = finish(asm)
    if asm.findings:
        raise ToolError.of(asm.findings)
    return obj, asm.messages


def _read_all(asm: Assembler) -> None:
    while not asm.ended:
        line = asm.source.next()
        if line is None:
            break
        try:
            _statement(asm, line)
        except (ExprError, SourceError, StatementError) as error:
            asm.error(str(error))


def _statement(asm: Assembler, line: str) -> None:
    """Assemble one line: labels, then an assignment, directive, macro call or instruction."""
    if not asm.conditionals.active:
        _skip(asm, line)
        return
    position = 0
    while ":" in line and (match := _LABEL.match(line, position)):
        asm.define_label(match[1])
        position = match.end()
    if position:
        line = line[position:]
    match = _STATEMENT.match(line)
    if match is None:
        rest = line.strip()
        if rest:
            raise ExprError(f"cannot read {rest!r}: expected a label, directive or instruction")
        return
    word, operands = match[1], match[2].rstrip()
    if operands[:1] == "=" and (assignment := _ASSIGN.match(line)):
        set_symbol(asm, assignment[1], assignment[2])
    elif (macro := asm.macros.get(word.lower())) is not None:
        _call_macro(asm, macro, operands)
    elif word[0] == ".":
        _directive(asm, word.lower(), operands)
    elif not asm.section.is_code:
        raise ExprError(f"instruction {word} in section {asm.section.name}, which is not a code section")
    else:
        assemble_instruction(asm, word, operands)


def _directive(asm: Assembler, word: str, operands: str) -> None:
    handler = DIRECTIVES.get(word)
    if handler is not None:
        handler(asm, operands)
    elif word in CONDITIONALS:
        asm.conditionals.process(word, operands, asm.source.place, asm)
    elif (instead := rejection(word)) is not None:
        raise ExprError(f"directive {word} does not exist in this assembler: {instead}")
    else:
        raise ExprError(f"unknown directive {word}")


def _skip(asm: Assembler, line: str) -> None:
    """Process a line inside a false conditional: only conditionals have an effect."""
    match = _STATEMENT.match(line)
    if match and match[1][0] == "." and match[1].lower() in CONDITIONALS:
        asm.conditionals.process(match[1].lower(), match[2].rstrip(), asm.source.place, asm)


def _call_macro(asm: Assembler, macro: Macro, operands: str) -> None:
    """Expand a macro call: its lines are read next."""
    lines = substitute(macro.body, bind(macro, operands), asm.serial)
    asm.serial += 1
    asm.source.expand(lines, asm.conditionals.depth, macro.name)


__all__ = ["Options", "assemble"]
