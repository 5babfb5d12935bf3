"""Reader of !DI metadata: fields of nodes and source positions."""

from __future__ import annotations

import os
import re

from toolchain.ir.model import Module

FIELD = re.compile(r'(\w+): ("(?:[^"\\]|\\.)*"|!DIExpression\([^)]*\)|[^,()]+)')
LIST = re.compile(r"!\d+|null")
MAX_DEPTH = 64


class DebugMetadata:
    """Metadata nodes of one module, each parsed once."""

    def __init__(self, module: Module) -> None:
        self.module = module
        self._nodes: dict[str, dict[str, str]] = {}
        self._files: dict[str, tuple[str, str]] = {}

    def node(self, ref: str) -> dict[str, str]:
        """Fields of node "!n"; the field "kind" is the class of the node, such as DISubprogram."""
        found = self._nodes.get(ref)
        if found is None:
            body = self.module.metadata.get(ref[1:], "")
            found = {k: v.strip('"') for k, v in FIELD.findall(body)}
            kind = re.match(r"(?:distinct )?!(\w+)\(", body)
            found["kind"] = kind[1] if kind else ""
            self._nodes[ref] = found
        return found

    def items(self, ref: str) -> list[str]:
        """Elements of a tuple node, "null" included."""
        return LIST.findall(self.module.metadata.get(ref[1:], "")) if ref.startswith("!") else []

    def number(self, ref: str, key: str, default: int = 0) -> int:
        """Integer field of a node, or `default`."""
        text = self.node(ref).get(key, "").strip()
        return int(text) if re.fullmatch(r"-?\d+", text) else default

    def bits(self, ref: str) -> int:
        """Size of a type in bits, with typedefs and qualifiers resolved; 0 if the type has no size."""
        for _ in range(MAX_DEPTH):
            if not ref.startswith("!"):
                return 0
            if size := self.number(ref, "size"):
                return size
            ref = self.node(ref).get("baseType", "")
        return 0

    def file(self, ref: str) -> tuple[str, str]:
        """Return (directory, name) of the DIFile of a node, or of its nearest enclosing scope with a DIFile."""
        if ref not in self._files:
            at = ref
            for _ in range(MAX_DEPTH):
                node = self.node(at)
                if node["kind"] == "DIFile":
                    break
                at = node.get("file") or node.get("scope") or ""
                if not at.startswith("!"):
                    break
            node = self.node(at) if at.startswith("!") else {}
            self._files[ref] = (node.get("directory", ""), node.get("filename", "?"))
        return self._files[ref]

    def position(self, ref: str | None) -> tuple[str, int] | None:
        """Return (file name, line) of a DILocation or DISubprogram; None without a line.

        The name is relative to the current folder if clang has removed the path of that folder from it."""
        if ref is None or not (line := self.number(ref, "line")):
            return None
        directory, name = self.file(ref)
        elsewhere = os.path.isabs(directory) and directory != os.getcwd()
        return (os.path.join(directory, name) if elsewhere else name), line

    def declared(self, ref: str | None) -> tuple[str, int] | None:
        """Return (file name, line) of a DISubprogram, or of the variable of a DIGlobalVariableExpression."""
        return self.position(self.node(ref).get("var", ref) if ref is not None else None)

    def marker(self, ref: str | None) -> list[str]:
        """Return the line marker of the assembly text for the code of a DISubprogram or the data of a variable."""
        position = self.declared(ref)
        return [f'# {position[1]} "{position[0]}"'] if position is not None else []

    def subprogram(self, ref: str) -> str:
        """The DISubprogram that contains a scope."""
        for _ in range(MAX_DEPTH):
            node = self.node(ref)
            if node["kind"] == "DISubprogram" or "scope" not in node:
                return ref
            ref = node["scope"]
        return ref
