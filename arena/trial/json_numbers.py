"""Numbers as JSON that every reader takes: what is no number, or beyond all bounds, is null."""

from __future__ import annotations

import json
import math
from typing import Any


def finite(value: Any) -> Any:
    """The same value of dictionaries, lists and numbers, with None for nan and both infinities."""
    if isinstance(value, dict):
        return {key: finite(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def json_text(value: Any, **options: Any) -> str:
    """`value` as `json.dumps` writes it with `options`."""
    return json.dumps(finite(value), allow_nan=False, **options)


def misfit(value: Any, shape: Any, name: str = "it") -> str:
    """What is first wrong with `value` of a JSON text; empty if it is of `shape`.

    A shape is a type, `[shape]` for a list of such, `(shape, ...)` for a list of just those, or `{key: shape}` for a
    table that has these keys among others; a key with `?` behind it may be missing or null.
    """
    if isinstance(shape, dict):
        if not isinstance(value, dict):
            return f"{name} is {value!r:.40}; expected a table"
        for key, inner in shape.items():
            here = value.get(key.rstrip("?"))
            wrong = "" if here is None and key.endswith("?") else misfit(here, inner, key.rstrip("?"))
            if wrong:
                return wrong
        return ""
    if isinstance(shape, list):
        shape = tuple(shape * len(value)) if isinstance(value, list) else ()
    if isinstance(shape, tuple):
        if not isinstance(value, list) or len(value) != len(shape):
            return f"{name} is {value!r:.40}; expected a list" + (f" of {len(shape)}" if shape else "")
        found = (misfit(value[place], inner, f"{name}[{place}]") for place, inner in enumerate(shape))
        return next(filter(None, found), "")
    kinds = (int, float) if shape is float else shape
    if not isinstance(value, kinds) or isinstance(value, bool):
        return f"{name} is {value!r:.40}; expected {shape.__name__}"
    return ""
