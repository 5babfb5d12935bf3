"""Rows of results as an HTML table for notebooks, and as a pandas DataFrame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from importlib import import_module
from typing import Any

MOST_SHOWN = 200
"""Maximum number of rows of an HTML table."""


def html_table(rows: Sequence[Mapping[str, Any]], caption: str = "") -> str:
    """Return the first rows as an HTML table; numbers are aligned to the right."""
    names = list(rows[0]) if rows else []
    head = "".join(f"<th>{escape(name)}</th>" for name in names)
    body = "".join(f"<tr>{''.join(_cell(row.get(name)) for name in names)}</tr>" for row in rows[:MOST_SHOWN])
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _cell(value: Any) -> str:
    if isinstance(value, int | float):
        return f'<td style="text-align:right">{value:,}</td>'
    return f'<td style="text-align:left">{escape(str(value))}</td>'


def data_frame(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Return the rows as a pandas DataFrame. Raises ModuleNotFoundError that names pandas if it is not installed."""
    try:
        pandas = import_module("pandas")
    except ModuleNotFoundError:
        raise ModuleNotFoundError("frame() needs pandas: pip install pandas", name="pandas") from None
    return pandas.DataFrame(list(rows))
