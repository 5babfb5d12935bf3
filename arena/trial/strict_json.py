"""JSON that every reader accepts, also in pages: nan and infinities become null. Validation against a shape."""

from __future__ import annotations

import json
import math
from typing import Any, Final

_SCRIPT_ESCAPES: Final = {ord(one): f"\\u{ord(one):04x}" for one in "<>&\u2028\u2029"}


def finite(value: Any) -> Any:
    """Return a copy of nested dictionaries and lists with None for nan and both infinities."""
    if isinstance(value, dict):
        return {key: finite(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def json_text(value: Any, **options: Any) -> str:
    """Return `value` as JSON; `options` are those of `json.dumps`."""
    return json.dumps(finite(value), allow_nan=False, **options)


def script_json(value: Any) -> str:
    """Return `value` as JSON for a `<script>` element: no text in it can end the element or change its parsing.

    The characters <, >, & and the line separators of JavaScript are written as escapes of JSON strings."""
    return json_text(value, separators=(",", ":")).translate(_SCRIPT_ESCAPES)


def mismatch(value: Any, shape: Any, name: str = "it") -> str:
    """Return the first mismatch between the JSON value and `shape`, or an empty text.

    A shape is one of:

    - a type
    - `[shape]`: a list of any length
    - `(shape, ...)`: a list of exactly these
    - `{key: shape}`: a table with at least these keys; a key that ends in `?` may be missing or null
    """
    if isinstance(shape, dict):
        if not isinstance(value, dict):
            return f"{name} is {value!r:.40}; expected a table"
        for key, inner in shape.items():
            here = value.get(key.rstrip("?"))
            wrong = "" if here is None and key.endswith("?") else mismatch(here, inner, key.rstrip("?"))
            if wrong:
                return wrong
        return ""
    if isinstance(shape, list):
        shape = tuple(shape * len(value)) if isinstance(value, list) else ()
    if isinstance(shape, tuple):
        if not isinstance(value, list) or len(value) != len(shape):
            return f"{name} is {value!r:.40}; expected a list" + (f" of {len(shape)}" if shape else "")
        found = (mismatch(value[place], inner, f"{name}[{place}]") for place, inner in enumerate(shape))
        return next(filter(None, found), "")
    kinds = (int, float) if shape is float else shape
    if not isinstance(value, kinds) or isinstance(value, bool):
        return f"{name} is {value!r:.40}; expected {shape.__name__}"
    return ""
