"""Debug information of one function, and the tree of its lexical blocks and inlined functions.

The tree is built from the line table. Every row names the scope of its code, so the addresses of a scope are those of
its own rows and of its inner scopes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from toolchain.debuginfo.metadata import DebugMetadata

REFERENCE = re.compile(r"!\d+")


@dataclass
class FunctionInfo:
    """Debug information of one compiled function: labels, line rows, variables."""

    name: str  # assembler symbol
    subprogram: str  # metadata reference
    end_label: str
    frame_base: tuple[int, int]  # register, and offset from it to the address that W15 had at entry
    rows: list[tuple[str, str, int]] = field(default_factory=list)  # (label, node of the source position, line)
    variables: list[tuple[str, int]] = field(default_factory=list)  # (DILocalVariable, offset from W15 at entry)
    ranges: dict[str, list[tuple[str, str, tuple[int, ...]]]] = field(default_factory=dict)  # start, end, words
    known: list[str] = field(default_factory=list)  # all variables, including those of inlined functions
    constants: dict[str, bytes] = field(default_factory=dict)  # variables with the same constant value everywhere
    objects: dict[int, int] = field(default_factory=dict)  # offset of each frame object from W15 at entry
    returned: frozenset[str] = frozenset()  # variables whose words are the address of the object that is returned


@dataclass
class DebugEntry:
    """Debugging information entry (DIE): tag, (attribute, form, value), children; `label` if referenced."""

    tag: str
    attributes: list[tuple[str, str, str | int | list[str]]]
    children: list[DebugEntry] = field(default_factory=list)
    label: str = ""


@dataclass
class LexicalScope:
    """A lexical block or, with `call`, an inlined function. `pieces` are pairs of labels around its code."""

    ref: str
    call: str = ""  # DILocation of the inlined call, "" for a lexical block
    pieces: list[tuple[str, str]] = field(default_factory=list)
    variables: list[DebugEntry] = field(default_factory=list)
    inside: dict[tuple[str, str], LexicalScope] = field(default_factory=dict)


def split_name(name: str) -> tuple[str, str]:
    """DILocalVariable and, if its function was inlined, DILocation of the call (`bindings.name_of`)."""
    ref, *call = REFERENCE.findall(name)
    return ref, call[0] if call else ""


class ScopeTree:
    """The scopes of one function."""

    def __init__(self, info: DebugMetadata, f: FunctionInfo) -> None:
        self.info = info
        self.top = LexicalScope(f.subprogram)
        ends = [label for label, _, _ in f.rows[1:]] + [f.end_label]
        for (start, node, _), end in zip(f.rows, ends, strict=True):
            location = info.node(node)
            if location["kind"] != "DILocation":
                continue
            at = self.top
            for ref, call in self._path(location.get("scope", ""), location.get("inlinedAt", "")):
                at = at.inside.setdefault((ref, call), LexicalScope(ref, call))
                if at.pieces and at.pieces[-1][1] == start:
                    at.pieces[-1] = (at.pieces[-1][0], end)
                else:
                    at.pieces.append((start, end))

    def add_variable(self, ref: str, call: str, die: DebugEntry) -> None:
        """Add a variable to the scope that declares it."""
        at = self.top
        for step in self._path(self.info.node(ref).get("scope", ""), call):
            at = at.inside.setdefault(step, LexicalScope(*step))
        at.variables.append(die)

    def _path(self, scope: str, call: str) -> list[tuple[str, str]]:
        """Scopes from the function down to `scope`, each with the call at which it was inlined, or ""."""
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
