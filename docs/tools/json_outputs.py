"""Write docs/json.md from the JSON Schemas of the outputs of --json: `python docs/tools/json_outputs.py [--write]`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from generated_part import GeneratedPart

ROOT: Final = Path(__file__).resolve().parents[2]
ERROR: Final = ROOT / "emu/host/schemas/error.json"
PROGRAMS: Final = ("emu", "toolchain", "arena", "openswarm")
LIKE: Final = "like "


def schemas() -> list[Path]:
    """Return the files of all schemas: those of the programs' outputs, then the error."""
    found = [path for one in PROGRAMS for path in sorted((ROOT / one / "commands" / "schemas").glob("*.json"))]
    return [*found, ERROR]


def page() -> str:
    """Return the sections of all outputs."""
    return "\n".join("\n".join(_section(path)) for path in schemas())


def _section(path: Path) -> Iterator[str]:
    schema = json.loads(path.read_text("utf-8"))
    place = path.relative_to(ROOT).as_posix()
    yield from ("", f"## {schema['title']}", "", f"{schema['description']} Schema: [{place}](../{place}).", "")
    yield from ("| key | type | meaning |", "|---|---|---|")
    for key, kind, text in _Keys(schema).rows(schema, ""):
        yield f"| `{key}` | {kind} | {text} |"


class _Keys:
    """The keys of one schema, as rows of a table. The keys of each definition are shown only once."""

    def __init__(self, schema: Any) -> None:
        self._definitions: Final = schema.get("$defs", {})
        self._shown: Final[dict[str, str]] = {}
        """Path of the first key with a definition, by the name of the definition."""

    def rows(self, part: Any, place: str) -> Iterator[tuple[str, str, str]]:
        """Yield path, type and meaning of every key in a part of the schema."""
        name = _definition(part)
        if name and self._shown.setdefault(name, place) != place:
            return
        part = self._definitions.get(name, part)
        for one in part.get("anyOf", ()):
            yield from self.rows(one, place)
        if "items" in part:
            yield from self.rows(part["items"], f"{place}[]")
        for key, one in part.get("properties", {}).items():
            here = f"{place}.{key}".lstrip(".")
            kind = self._type(one) + ("" if key in part.get("required", ()) else ", optional")
            yield here, kind, one["description"].replace("|", "\\|")
            yield from self.rows(one, here)
        if part.get("additionalProperties"):
            here = f"{place}.*".lstrip(".")
            if not place:
                yield here, self._type(part["additionalProperties"]), "Any other key."
            yield from self.rows(part["additionalProperties"], here)

    def _type(self, part: Any) -> str:
        """Return the type of a value in words."""
        reference = part.get("$ref", "")
        if reference.endswith(".json"):
            name = reference.removesuffix(".json")
            return f"[{name}](#{name})"
        name = _definition(part)
        if name in self._shown:
            return f"{LIKE}`{self._shown[name]}`"
        part = self._definitions.get(name, part)
        if "enum" in part:
            return ", ".join(f'"{one}"' for one in part["enum"])
        if "anyOf" in part:
            return " or ".join(map(self._type, part["anyOf"]))
        kinds = part.get("type", "any")
        inner = part.get("items") or part.get("additionalProperties")
        if kinds in ("array", "object") and inner:
            type_ = self._type(inner)
            return f"{kinds} of {'values ' if type_.startswith(LIKE) else ''}{type_}"
        return kinds if isinstance(kinds, str) else " or ".join(kinds)


def _definition(part: Any) -> str:
    """Return the name of the definition that a part of a schema refers to, "" if it refers to none."""
    reference = part.get("$ref", "") if isinstance(part, dict) else ""
    return reference.removeprefix("#/$defs/") if reference.startswith("#") else ""


PART: Final = GeneratedPart(ROOT / "docs/json.md", "<!-- json_outputs.py -->\n", page)

if __name__ == "__main__":
    sys.exit(PART.command())
