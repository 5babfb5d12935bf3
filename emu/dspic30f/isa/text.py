"""Assembly text of instructions: ``format`` writes binutils' spelling, ``parse`` reads what pic30-as accepts."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias

from .codec import EncodeError, encode
from .operands import FileBit, Kind, OperandError, Part, Site, SymbolOf
from .row import Insn, Row
from .syntax import FORMS, Form, kinds_of, printed_mnemonic

# Explanations of broken rules. A rule that is not listed is shown as the table writes it.
EXPLANATION = {
    "d!=14": "the product cannot go to w14",
    "s>=2": "the divisor cannot be w0",
    "v even": "the dividend must begin at an even register",
    "p=0: s even": "a register pair begins at an even register",
    "p>=1": "the source must be a pointer",
    "q>=1": "the destination must be a pointer",
}
# pic30-as accepts w1 as divisor although the manual forbids it (isa.md §6.7); for the CPU the word is illegal.
TOLERATED = (("s>=2", 1),)


class Expression(Protocol):
    """Result of the caller's expression parser. ``value`` is None if the number is not known yet."""

    @property
    def value(self) -> int | None: ...


Expr: TypeAlias = Callable[[str], Expression]


class StatementError(ValueError):
    """The statement is not a valid instruction; the message says what was expected."""


@dataclass(frozen=True, slots=True)
class Slot:
    """A numeric operand. ``expression`` is what the caller's parser returned; its value may still be unknown.

    ``relocation`` is the R_PIC30_ name for a plain symbol (abi-elf.md §5), and ``PGM_ADDR`` stands for the pair in CALL
    and GOTO; "" if only a number is permitted. ``addend`` is added to the symbol.
    """

    kind: Kind
    expression: Any
    relocation: str
    addend: int


@dataclass(frozen=True, slots=True)
class Parsed:
    """A parsed statement: the row, the known fields, and the numeric operands."""

    row: Row
    fields: Mapping[str, int]
    byte: bool = False
    slots: tuple[Slot, ...] = ()
    statement: str = field(default="", compare=False)

    @property
    def words(self) -> int:
        """Return the length in instruction words, 1 or 2. It does not depend on operand values."""
        return self.row.words

    def encode(self, pc: int, values: Mapping[int, int | None] | None = None) -> tuple[int, ...]:
        """Return the words at program address ``pc``.

        ``values`` gives numbers for slots by position and overrides the expressions' values. A slot without a number
        leaves its field 0, for a relocation to fill. Raises StatementError if a value or combination cannot be encoded.
        """
        site = Site(self.row, pc, self.byte)
        fields = dict(self.fields)
        for i, slot in enumerate(self.slots):
            value = values.get(i) if values and i in values else slot.expression.value
            if value is None:
                continue
            try:
                fields |= {letter: number + slot.addend for letter, number in slot.kind.number(value, site).items()}
            except OperandError as error:
                raise StatementError(f"{self.statement}: {error}") from None
        try:
            return encode(self.row, fields, tolerate=TOLERATED)
        except EncodeError as error:
            raise StatementError(f"{self.statement}: {_reason(error)}") from None


def _reason(error: EncodeError) -> str:
    if error.clause is not None:
        return EXPLANATION.get(error.clause.text, f"{error.clause.text} does not hold")
    if error.letter == "t":  # a pair from W15 on, whose high half would be W16
        return EXPLANATION["v even"]
    if error.letter in ("s", "d"):
        return f"w{error.value} is not an even register"
    return f"field {error.letter} cannot hold {error.value}"


def format(insn: Insn, pc: int = 0, symbol: SymbolOf | None = None, source: bool = False) -> str:
    """Return the assembly text of an instruction at program address ``pc``, as binutils prints it.

    ``symbol(address, space)`` may return a name for an address; ``space`` is "code" or "data". With ``source``, the
    text can be parsed again: it keeps negative literals and wrapped targets, and omits ignored register fields.
    """
    site = Site(insn.row, pc)
    tokens = [t for kind in kinds_of(insn.row.syntax) for t in kind.write(insn.x, site, symbol, source)]
    mnemonic = printed_mnemonic(insn.row, getattr(insn.x, "B", 0))
    return f"{mnemonic} {', '.join(tokens)}" if tokens else mnemonic


@dataclass(frozen=True, slots=True)
class Number:
    """Default expression parser: integers with the prefixes of C."""

    value: int

    @classmethod
    def read(cls, text: str) -> Number:
        """Parse a number. Raises StatementError if ``text`` is not one."""
        try:
            return cls(int(re.sub(r"\s", "", text), 0))
        except ValueError:
            raise StatementError(f"{text!r} is not a number") from None


def parse(statement: str, expr: Expr = Number.read) -> Parsed:
    """Parse one instruction without label and comment.

    ``expr`` parses the expressions in operands and may raise its own errors. Its result must have a ``value``, an int
    or None. Raises StatementError for an unknown mnemonic and for operands that fit no form.
    """
    statement = statement.strip()
    mnemonic, *rest = statement.split(None, 1) or [""]
    choices = FORMS.get(mnemonic.lower())
    if choices is None:
        raise StatementError(f"unknown instruction {mnemonic!r}")
    tokens = split_operands(rest[0] if rest else "")
    for form, byte in choices:
        site = Site(form.row, 0, byte)
        parts = _match(form, site, tokens)
        if parts is not None:
            try:
                return _parsed(form, site, parts, expr, statement)
            except OperandError as error:
                raise StatementError(f"{statement}: {error}") from None
    absent = next((n for n in re.findall(r"\b[wW](\d+)\b", " ".join(tokens)) if int(n) > 15), None)
    if absent is not None:
        raise StatementError(f"{statement}: there is no register W{absent}, only W0 to W15")
    accepted = " | ".join(form.syntax for form, _ in choices)
    raise StatementError(f"{statement}: operands fit none of {accepted}")


def split_operands(text: str) -> list[str]:
    """Split an operand list at commas outside brackets, parentheses and character literals."""
    pieces, depth, start, i = [], 0, 0, 0
    while i < len(text):
        c = text[i]
        if c == "'":
            i += 2 if text[i + 1 : i + 2] == "\\" else 1
            i += 1 if text[i + 1 : i + 2] == "'" else 0
        elif c in "([":
            depth += 1
        elif c in ")]":
            depth -= 1
        elif c == "," and depth == 0:
            pieces.append(text[start:i].strip())
            start = i + 1
        i += 1
    pieces.append(text[start:].strip())
    return [] if pieces == [""] else pieces


def _match(form: Form, site: Site, tokens: Sequence[str]) -> list[tuple[Kind, Part]] | None:
    """Return the operands by kind if the tokens match the form, else None."""
    parts, rest = [], list(tokens)
    for kind in kinds_of(form.syntax):
        part = kind.read(rest, site)
        if part is None:
            return None
        parts.append((kind, part))
        rest = rest[part.taken :]
    return None if rest else parts


def _parsed(form: Form, site: Site, parts: Sequence[tuple[Kind, Part]], expr: Expr, statement: str) -> Parsed:
    fields = dict(form.fixed)
    if "B" in form.row.fields:
        fields["B"] = int(site.byte)
    slots = []
    for kind, part in parts:
        if "w" in part.fields and fields.get("w", part.fields["w"]) != part.fields["w"]:
            raise OperandError("both operands must use the same index register")
        fields |= part.fields
        addend = 0
        if isinstance(kind, FileBit):
            fields["b"], addend = kind.bit(expr(part.bit).value, site)
        if part.text is not None:
            slots.append(Slot(kind, expr(part.text), kind.relocation(site), addend))
    return Parsed(form.row, fields, site.byte, tuple(slots), statement)
