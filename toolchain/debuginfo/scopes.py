"""What debug information says of one function, and the tree of its lexical blocks and inlined functions.

The tree is made from the line table: every row names the scope of its code, so a scope's addresses are those of its
rows and of the scopes inside it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from toolchain.debuginfo.metadata import DebugInfo

REFERENCE = re.compile(r"!\d+")


@dataclass
class FunctionInfo:
    """What the back end reports of one function: labels, line rows, frame variables."""

    name: str  # assembler symbol
    subprogram: str  # metadata reference
    end_label: str
    frame_base: tuple[int, int]  # register, offset of W15 at entry from it
    rows: list[tuple[str, str, int]] = field(default_factory=list)  # label, position node, line
    variables: list[tuple[str, int]] = field(default_factory=list)  # DILocalVariable, offset from W15 at entry
    ranges: dict[str, list[tuple[str, str, tuple[int, ...]]]] = field(default_factory=dict)  # start, end, registers
    known: list[str] = field(default_factory=list)  # every variable there is, also those of inlined functions
    constants: dict[str, bytes] = field(default_factory=dict)  # variables that are one number everywhere
    objects: dict[int, int] = field(default_factory=dict)  # frame object -> offset from W15 at entry


@dataclass
class Die:
    """One entry: tag, (attribute, form, value), children. `label` marks a type that others refer to."""

    tag: str
    attributes: list[tuple[str, str, str | int | list[str]]]
    children: list[Die] = field(default_factory=list)
    label: str = ""


@dataclass
class Scope:
    """One lexical block or, with `call`, one inlined function. `pieces` are pairs of labels around its code."""

    ref: str
    call: str = ""  # DILocation of the call that was replaced by the function
    pieces: list[tuple[str, str]] = field(default_factory=list)
    variables: list[Die] = field(default_factory=list)
    inside: dict[tuple[str, str], Scope] = field(default_factory=dict)


def split_name(name: str) -> tuple[str, str]:
    """DILocalVariable and, when its function was inlined, the call (`bindings.name_of`)."""
    ref, *call = REFERENCE.findall(name)
    return ref, call[0] if call else ""


class Scopes:
    """The tree of one function."""

    def __init__(self, info: DebugInfo, f: FunctionInfo) -> None:
        self.info = info
        self.top = Scope(f.subprogram)
        ends = [label for label, _, _ in f.rows[1:]] + [f.end_label]
        for (start, node, _), end in zip(f.rows, ends, strict=True):
            location = info.node(node)
            if location["kind"] != "DILocation":
                continue
            at = self.top
            for ref, call in self._path(location.get("scope", ""), location.get("inlinedAt", "")):
                at = at.inside.setdefault((ref, call), Scope(ref, call))
                if at.pieces and at.pieces[-1][1] == start:
                    at.pieces[-1] = (at.pieces[-1][0], end)
                else:
                    at.pieces.append((start, end))

    def place(self, ref: str, call: str, die: Die) -> None:
        """Enter a variable into the scope that declares it."""
        at = self.top
        for step in self._path(self.info.node(ref).get("scope", ""), call):
            at = at.inside.setdefault(step, Scope(*step))
        at.variables.append(die)

    def _path(self, scope: str, call: str) -> list[tuple[str, str]]:
        """Scopes from the function down to this one: (reference, call it was inlined at)."""
        path: list[tuple[str, str]] = []
        for _ in range(1000):
            node = self.info.node(scope)
            if node["kind"] == "DISubprogram":
                if not call:
                    break
                path.append((scope, call))
                location = self.info.node(call)
                scope, call = location.get("scope", ""), location.get("inlinedAt", "")
            elif node["kind"] == "DILexicalBlock":
                path.append((scope, ""))
                scope = node.get("scope", "")
            elif node["kind"] == "DILexicalBlockFile":
                scope = node.get("scope", "")
            else:
                break
        return path[::-1]
