"""Source positions and DWARF from !DI metadata."""

from __future__ import annotations

import re

from ..ir.model import Module

FIELD = re.compile(r"(\w+): (\"[^\"]*\"|[^,()]+)")


def fields(module: Module, ref: str) -> dict[str, str]:
    """Fields of a metadata node given as !n."""
    body = module.metadata.get(ref.lstrip("!"), "")
    return {k: v.strip('"') for k, v in FIELD.findall(body)}


def source_position(module: Module, ref: str | None) -> tuple[str, int] | None:
    """(file, line) of a DILocation or DISubprogram."""
    if ref is None:
        return None
    node = fields(module, ref)
    if "line" not in node:
        return None
    scope = node.get("scope", "")
    file = node.get("file", "")
    for _ in range(64):
        if file.startswith("!") or not scope.startswith("!"):
            break
        up = fields(module, scope)
        file, scope = up.get("file", ""), up.get("scope", "")
    name = fields(module, file).get("filename", "?") if file.startswith("!") else "?"
    return name, int(node["line"])
