"""Inline assembly statements: their possible positions in the code, and the registers of their operands.

A statement is identified by its text.  Each sequence of assembly lines that matches a template of the IR is marked with
labels.  Where the source reaches a statement, the code must reach a matching sequence whose operands hold the same
values.  The meaning of the instructions is not examined.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from toolchain.frontend.asm_constraints import CLASSES, MARK
from toolchain.ir.model import InlineAsm, Module
from toolchain.proof.solver import Undecided
from toolchain.select.asm_inline import REGISTER_NAMES

LABEL: Final = "__statement_"
REFERENCE: Final = re.compile(r"\$(?:(\d+)|\{(\d+)(?::(\w))?\}|\{:uid\}|(\$))")
"""Operand references in a template as clang writes GCC's %0, %d1 and %=; and an escaped dollar sign."""
PART: Final = re.compile(r"[^,{]*\{[^}]*\}[^,]*|[^,]+")
REGISTER: Final = re.compile(r"w(\d+)")


@dataclass(frozen=True)
class Operand:
    """One operand constraint.

    early  whether an output is written before all inputs are read
    tied   number of the output that the operand shares registers with, None without one
    fixed  its first register, if the constraint names one
    """

    output: bool
    early: bool
    tied: int | None
    fixed: int | None
    allowed: tuple[int, ...] | None
    """Registers of the operand's class, if the constraint names a class."""


@dataclass(frozen=True)
class Shape:
    """Constraints of a statement: operands by number, clobbered registers, and whether memory is clobbered."""

    operands: tuple[Operand, ...]
    clobbered: frozenset[int]
    memory: bool


@dataclass(frozen=True)
class Statement:
    """A code sequence, up to the address `end`, that matches a template.

    texts  text of each operand reference, by operand number and modifier
    """

    template: str
    end: int
    texts: Mapping[tuple[int, str], str]

    def register(self, number: int, operand: Operand) -> int | None:
        """Return the first register of an operand that is not tied, None if it has none."""
        if operand.fixed is not None:
            return operand.fixed
        found = REGISTER.fullmatch(self.texts.get((number, ""), ""))
        return int(found[1]) if found else None


def shape_of(code: InlineAsm) -> Shape:
    """Return the constraints of a statement; raises Undecided for operands in memory."""
    operands: list[Operand] = []
    clobbered: set[int] = set()
    memory = False
    mark = MARK.match(code.text)
    classes = dict(re.findall(r"(\d+)([a-z])", mark[1])) if mark else {}
    for part in PART.findall(code.constraints):
        body = part.lstrip("=").replace("&", "").replace("%", "")
        named = re.search(r"\{(.*)\}", body)
        if part.startswith("~"):
            assert named is not None
            memory |= named[1] == "memory"
            clobbered |= {REGISTER_NAMES[named[1]]} if named[1] in REGISTER_NAMES else set()
            continue
        if "*" in part or "|" in part:
            raise Undecided("assembly with an operand in memory")
        letter = classes.get(str(len(operands)))
        operands.append(Operand(
            part.startswith("="), "&" in part, int(body) if body.isdigit() else None,
            REGISTER_NAMES[named[1]] if named else None, CLASSES[letter] if letter else None,
        ))  # fmt: skip
    return Shape(tuple(operands), frozenset(clobbered), memory)


def plain(text: str) -> str:
    """Return a template without the mark that `asm_constraints` adds."""
    return MARK.sub("", text)


def templates(module: Module) -> set[str]:
    """Return the templates of all assembly statements that are not empty."""
    codes = [i.args[-1] for f in module.functions.values() for b in f.blocks for i in b.instrs if i.op == "call"]
    return {plain(code.text) for code in codes if isinstance(code, InlineAsm) and code.text.strip()}


def marked(text: str, wanted: Iterable[str]) -> tuple[str, list[tuple[str, str, dict[tuple[int, str], str], str]]]:
    """Return assembly text with labels around each sequence that matches a template, and a list of these sequences.

    A sequence is (label at its start, template, operand texts, label after it).
    """
    found = []
    for template in sorted(wanted):
        pattern = _pattern(template)
        match = pattern.search(text)
        while match is not None:
            parts = {(int(k.split("_")[1]), k.split("_")[2]): v for k, v in match.groupdict().items()}
            found.append((match.start(), template, parts, match.end()))
            match = pattern.search(text, match.start() + 1)
    labels = {at: f"{LABEL}{n}" for n, at in enumerate(sorted({at for f in found for at in (f[0], f[3])}))}
    out, behind = [], 0
    for at, label in labels.items():
        out += [text[behind:at], f"{label}:\n"]
        behind = at
    return "".join([*out, text[behind:]]), [(labels[a], template, parts, labels[b]) for a, template, parts, b in found]


def _pattern(template: str) -> re.Pattern[str]:
    seen: set[str] = set()

    def line(text: str) -> str:
        out, behind = "", 0
        for m in REFERENCE.finditer(text):
            out += re.escape(text[behind : m.start()])
            behind = m.end()
            number = m[1] or m[2]
            group = f"o_{number}_{m[3] or ''}"
            if number is None:
                out += r"\$" if m[4] else r"\w+"
            elif group in seen:
                out += f"(?P={group})"
            else:
                seen.add(group)
                out += rf"(?P<{group}>[\w.+()-]+)"
        return rf"\t{out}{re.escape(text[behind:])}\n"

    return re.compile("^" + "".join(line(one.strip()) for one in template.split("\n") if one.strip()), re.MULTILINE)
