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
