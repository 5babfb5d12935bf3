"""Arguments of an editor's launch configuration: names and types."""

from __future__ import annotations

import json
from typing import Any, Final

KINDS: Final[dict[str, tuple[type, str]]] = {
    "program": (str, "the path of an ELF file"),
    "board": (str, "the name of a board"),
    "selector": (int, "a whole number"),
    "camera": (str, "the path of a picture"),
    "engine": (str, "the name of an engine"),
    "strict": (bool, "true or false"),
    "stopOnEntry": (bool, "true or false"),
    "sourceRoots": (list, "a list of folders"),
}
"""Type and description of each argument. Editors also send arguments of their own."""


def validated(arguments: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments that are not null. Raises ValueError for one of the wrong type."""
    given = {name: value for name, value in arguments.items() if value is not None}
    for name, (kind, words) in KINDS.items():
        value = given.get(name)
        fits = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
        if kind is list and fits:
            fits = all(isinstance(one, str) for one in given[name])
        if name in given and not fits:
            raise ValueError(f"`{name}` must be {words}, not {json.dumps(value)}")
    return given
