"""Make the kernel reference from the headers: one anchor per call, with its contract as a table.

The contract is the comment above a call: callers, blocking, worst-case Tcy, stack bytes, error codes and description
(openswarm.h explains it). Calls without a comment of their own share that of the call above.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).resolve().parents[2] / "firmware/openswarm/include"
FIELDS: Final = ("Callers", "Blocks", "Tcy at most", "Stack bytes", "Errors")
CALL: Final = re.compile(r"(?:#define |static inline |(?!typedef)[\w ]+[ *]+)(Sys_\w+)\(")
SECTION: Final = re.compile(r"^/\* -{4} (.+?) -+ \*/$")


@dataclass(frozen=True)
class Call:
    """A call of the kernel: its name, its C declaration, and the comment that has its contract."""

    name: str
    declaration: str
    comment: str

    @property
    def contract(self) -> list[tuple[str, str]]:
        """Fields of the contract line and their values; empty for a comment without one."""
        cells = [cell.strip() for cell in self.comment.split(" | ")]
        if len(cells) < len(FIELDS):
            return []
        errors = _sentence_end(cells[len(FIELDS) - 1])[0]
        return list(zip(FIELDS, [*cells[: len(FIELDS) - 1], errors], strict=True))

    @property
    def description(self) -> str:
        """What the call does, in sentences."""
        cells = self.comment.split(" | ")
        if len(cells) < len(FIELDS):
            return self.comment
        return _sentence_end(" | ".join(cells[len(FIELDS) - 1 :]))[1]


def _sentence_end(text: str) -> tuple[str, str]:
    """Split the error codes from the description: at the full stop with two blanks, or at the first full stop."""
    errors, _, rest = text.partition(".  ")
    if not rest:
        errors, _, rest = text.partition(". ")
    return errors.strip().removesuffix("."), rest.strip()


def plain(comment: str) -> str:
    """Return the text of a C comment in one line per paragraph."""
    body = re.sub(r"^/\*+|\*/$", "", comment.strip())
    lines = [re.sub(r"^ ?\* ?", "", line).rstrip() for line in body.splitlines()]
    return "\n".join(lines).strip()


def parts_of(text: str) -> Iterator[tuple[str, str]]:
    """Yield the parts of a header in order as (kind, text): comment, directive or declaration."""
    lines = iter(text.splitlines())
    for line in lines:
        part, kind, is_whole = line, "declaration", _is_declaration
        if not line.strip() or line.startswith(("}", 'extern "C"')):
            continue
        if line.startswith("/*"):
            kind, is_whole = "comment", lambda so_far: so_far.endswith("*/")
        elif line.startswith("#"):
            kind, is_whole = "directive", lambda so_far: not so_far.endswith("\\")
        while not is_whole(part):
            part += "\n" + next(lines)
        yield kind, part


def _is_declaration(part: str) -> bool:
    """Whether a part is a whole declaration: its braces are closed, and it ends with a semicolon."""
    code = re.sub(r"/\*.*?\*/", "", part, flags=re.DOTALL).strip()
    return code.count("{") == code.count("}") and code.endswith((";", "}"))


def calls_of(header: Path) -> list[Call]:
    """Return the calls that a header declares, in order."""
    return [one for one in _items(header.read_text(encoding="utf-8")) if isinstance(one, Call)]


def _items(text: str) -> Iterator[Call | str]:
    """Yield the calls of a header, and Markdown text for its sections and types."""
    comment, described, head = "", "", head_of(text)
    for kind, part in parts_of(text):
        name = CALL.match(part) if kind != "comment" else None
        if kind == "comment":
            section, comment = SECTION.match(part), plain(part)
            if section is not None:
                yield f"### {section[1]}\n"
            if section is not None or comment == head:
                comment = ""
        elif name is not None:
            if kind == "directive":
                part = part.splitlines()[0].removesuffix("\\")
            yield Call(name[1], part.strip(), " ".join(comment.split()))
            described = comment
        elif kind == "declaration":
            own = "" if comment == described else " ".join(comment.split())  # not the contract of the call above
            yield f"{own}\n\n```c\n{part.strip()}\n```\n"
            comment = ""


def head_of(text: str) -> str:
    """Return the first comment of a header after its licence: what the header is for."""
    comments = [plain(part) for kind, part in parts_of(text) if kind == "comment"]
    return next((one for one in comments if "SPDX" not in one), "")


def prose(text: str) -> str:
    """Return plain text in Markdown: sentences as paragraphs with their options as code, everything else as code.

    A paragraph is sentences unless it is a usage, an example, a list, a table or a command.
    """
    return "\n".join(_paragraph(part) for part in re.split(r"\n\n+", text) if part)


def _paragraph(part: str) -> str:
    if re.match(r"usage:|examples?:|\w[\w ]*:$", part) or re.search(r"^ |\S  |^[$-] ", part, re.MULTILINE):
        columns = len(re.findall(r"\S {2,}\S", part)) > 1
        return f"```{'{ .text .columns }' if columns else 'text'}\n{part}\n```\n"
    words = re.sub("`([^`]+)`", r"<code>\1</code>", html.escape(" ".join(part.split())))
    return "<p>" + re.sub(r"(?<![\w-])--[a-z][\w-]+", r"<code>\g<0></code>", words) + "</p>\n"


INTRODUCTION: Final = """# Kernel calls

Every call with its contract, from the headers in `firmware/openswarm/include`. Callers: M = main before
`Sys_Start_Kernel`, T = thread, H = event handler or condition, I = interrupt service routine of priority 4. The
description of `openswarm.h` explains the letters in the Tcy.
"""


def page() -> str:
    """Return the reference of all headers as Markdown."""
    parts = [INTRODUCTION]
    for header in sorted(FOLDER.glob("*.h")):
        text, last = header.read_text(encoding="utf-8"), ""
        parts.append(f"## {header.name}\n\n{prose(head_of(text))}\n\n")
        for one in _items(text):
            if isinstance(one, str):
                parts.append(one)
                continue
            parts.append(f"#### {one.name} {{#{one.name}}}\n\n```c\n{one.declaration}\n```\n")
            parts.append(
                "Contract and description are those of the call above.\n" if one.comment == last else _about(one)
            )
            last = one.comment
    return "\n".join(parts).replace("\n```\n\n\n\n```c\n", "\n")  # types in a row, without a comment between them


def _about(one: Call) -> str:
    """Return contract and description of a call as Markdown."""
    if not one.contract:
        return one.description + "\n"
    rows = ([name for name, _ in one.contract], ["---"] * len(FIELDS), [value for _, value in one.contract])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows) + f"\n\n{one.description}\n"
