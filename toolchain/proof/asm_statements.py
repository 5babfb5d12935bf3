"""Assembly statements: where the code may have one, and in which registers its operands are.

A statement is its text: the same instructions on operands that hold what they should are the statement, whoever wrote
them. So each stretch of the assembly text that reads like a template of the IR is marked with labels; where the source
comes to a statement, the code must come to one of its stretches. What the instructions do is nobody's business.
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
"""What a template has of operands (GCC's %0, %d1, %=, and a dollar sign), as clang hands it over."""
PART: Final = re.compile(r"[^,{]*\{[^}]*\}[^,]*|[^,]+")
REGISTER: Final = re.compile(r"w(\d+)")


@dataclass(frozen=True)
class Operand:
    """One of the constraints. `tied`: number of the output it shares registers with; `fixed`: the first of them."""

    output: bool
    early: bool
    tied: int | None
    fixed: int | None
    allowed: tuple[int, ...] | None
    """Registers of its class, where it names one."""


@dataclass(frozen=True)
class Shape:
    """What the constraints say: operands by number, registers that are overwritten, whether memory may be."""

    operands: tuple[Operand, ...]
    clobbered: frozenset[int]
    memory: bool


@dataclass(frozen=True)
class Statement:
    """A stretch of code, up to the address `end`, that reads like a template. `texts`: what stands for an operand, by
    number and modifier."""

    template: str
    end: int
    texts: Mapping[tuple[int, str], str]

    def register(self, number: int, operand: Operand) -> int | None:
        """The first register of an operand that is not tied, None if it has none."""
        if operand.fixed is not None:
            return operand.fixed
        found = REGISTER.fullmatch(self.texts.get((number, ""), ""))
        return int(found[1]) if found else None


def shape_of(code: InlineAsm) -> Shape:
    """Raises Undecided."""
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
    """A template without the front end's mark."""
    return MARK.sub("", text)


def templates(module: Module) -> set[str]:
    """Of all statements that have text."""
    codes = [i.args[-1] for f in module.functions.values() for b in f.blocks for i in b.instrs if i.op == "call"]
    return {plain(code.text) for code in codes if isinstance(code, InlineAsm) and code.text.strip()}


def marked(text: str, wanted: Iterable[str]) -> tuple[str, list[tuple[str, str, dict[tuple[int, str], str], str]]]:
    """Assembly text with labels around each stretch that reads like one of the templates; of each the label it begins
    with, its template, what stands for operands, and the label behind it."""
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
