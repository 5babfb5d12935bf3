"""The JSON Schemas of the outputs of --json, for the tests that run the commands.

`jsonschema` is imported where it is used: its import takes a second of CPU where the extra `docs` is installed.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote, urlparse

from referencing import Registry, Resource

ROOT: Final = Path(__file__).resolve().parents[1]
ERROR: Final = ROOT / "emu/host/schemas/error.json"


def _retrieve(uri: str) -> Resource[Any]:
    """Return the schema in a file, to which another one refers by name."""
    return Resource.from_contents(json.loads(Path(unquote(urlparse(uri).path)).read_text("utf-8")))


_REGISTRY: Final[Registry[Any]] = Registry(retrieve=_retrieve)  # type: ignore[call-arg]


def path_of(program: str, output: str) -> Path:
    """Return the file of the schema of an output, such as "run" of "emu"."""
    return ROOT / program / "commands" / "schemas" / f"{output}.json"


def problems(schema: Path, value: Any) -> list[str]:
    """Return the differences between a value and a schema, each as one line."""
    from jsonschema import Draft202012Validator

    validator = Draft202012Validator({"$ref": schema.as_uri()}, registry=_REGISTRY)
    return [f"{one.json_path}: {one.message}" for one in validator.iter_errors(value)]


def validated(program: str, output: str, text: str) -> Any:
    """Return the value of an output of --json, which fits its schema."""
    value = json.loads(text)
    assert problems(path_of(program, output), value) == []
    return value
