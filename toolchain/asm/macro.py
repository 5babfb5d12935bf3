"""Macros: definition heads, arguments, substitution (GNU as 2.14 rules: `\\name`, `\\@`, `\\()`, defaults)."""

from __future__ import annotations

import re
from dataclasses import dataclass

from toolchain.asm.source import SourceError

OPEN_MACRO = re.compile(r"\s*(?:[\w.$]+:\s*)*\.macro\b", re.IGNORECASE)
CLOSE_MACRO = re.compile(r"\s*\.endm(?:acro)?\b", re.IGNORECASE)
OPEN_REPEAT = re.compile(r"\s*(?:[\w.$]+:\s*)*\.(?:rept|irpc?)\b", re.IGNORECASE)
CLOSE_REPEAT = re.compile(r"\s*\.endr\b", re.IGNORECASE)

_PARAMETER = re.compile(r"\s*([A-Za-z_.$][\w.$]*)\s*(?:=\s*(\"(?:\\.|[^\"\\])*\"|[^\s,]*))?\s*,?")
_USE = re.compile(r"\\(?:([A-Za-z_$][\w$]*)|(@)|(\(\)))")  # a dot ends the name, as in `\\reg.b`


@dataclass(slots=True)
class Macro:
    """A macro: its parameters in order with their defaults, and the lines of its body."""

    name: str
    parameters: dict[str, str]
    body: list[str]


def parse_head(text: str) -> tuple[str, dict[str, str]]:
    """Parse the text after `.macro`; return the name, and the parameters with their defaults."""
    match = re.match(r"\s*([A-Za-z_.$][\w.$]*)\s*,?", text)
    if match is None:
        raise SourceError("expected a name after .macro")
    parameters: dict[str, str] = {}
    position = match.end()
    rest = text.rstrip()
    while position < len(rest):
        parameter = _PARAMETER.match(rest, position)
        if parameter is None or parameter.end() == position:
            raise SourceError(f"cannot read macro parameter {rest[position:].strip()!r}")
        if parameter[1] in parameters:
            raise SourceError(f"macro parameter {parameter[1]} is named twice")
        parameters[parameter[1]] = _unquote(parameter[2] or "")
        position = parameter.end()
    return match[1], parameters


def _unquote(text: str) -> str:
    return text[1:-1] if len(text) >= 2 and text[0] == text[-1] == '"' else text


_PIECE = re.compile(r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\\])\'?|\s+|.', re.DOTALL)
_GROUPING = re.compile(r"[\"'(\[]")
_OPERATOR_CHARACTERS = "-+*/%|&^~<>()=[]"


def split_arguments(text: str, spaces: bool = True) -> list[str]:
    """Split at commas outside quotes and brackets and, with `spaces`, at blanks not adjacent to an operator."""
    text = text.strip()
    if not text:
        return []
    if not spaces and not _GROUPING.search(text):
        return [part.strip() for part in text.split(",")]
    parts: list[str] = [""]
    depth = 0
    pieces: list[str] = _PIECE.findall(text)
    for piece, following in zip(pieces, [*pieces[1:], ","], strict=True):
        depth += (piece in ("(", "[")) - (piece in (")", "]"))
        comma = piece == ","
        blank = spaces and piece.isspace() and _separates(parts[-1], following)
        if depth <= 0 and (comma or blank):
            parts.append("")
        else:
            parts[-1] += piece
    return [part.strip() for part in parts]


def _separates(before: str, following: str) -> bool:
    """Whether a blank between `before` and `following` separates two macro arguments."""
    if not before.strip() or following == ",":
        return False
    return before[-1] not in _OPERATOR_CHARACTERS and following[0] not in _OPERATOR_CHARACTERS


def bind(macro: Macro, text: str) -> dict[str, str]:
    """Return parameter values for a call of `macro` with argument text `text`."""
    values = dict(macro.parameters)
    names = list(values)
    position = 0
    for argument in split_arguments(text):
        keyword = re.match(r"([A-Za-z_.$][\w.$]*)\s*=(?!=)\s*(.*)", argument, re.DOTALL)
        if keyword and keyword[1] in values:
            values[keyword[1]] = _unquote(keyword[2])
            continue
        if position >= len(names):
            raise SourceError(f"macro {macro.name} takes {len(names)} arguments, got more")
        if argument:
            values[names[position]] = _unquote(argument)
        position += 1
    return values


def substitute(lines: list[str], values: dict[str, str], serial: int) -> list[str]:
    """Return `lines` with `\\name`, `\\@` (the expansion's number) and `\\()` replaced."""

    def replace(match: re.Match[str]) -> str:
        name, at, nothing = match.groups()
        if at:
            return str(serial)
        if nothing:
            return ""
        return values.get(str(name), match[0])

    return [_USE.sub(replace, line) if "\\" in line else line for line in lines]
