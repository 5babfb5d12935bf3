"""`arena keys`: the page of the documentation, and one row per key of the schema."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import pytest

from arena.cli import main
from arena.scene.schema import LISTS, TABLES

PAGE = Path(__file__).parents[3] / "docs/scene-keys.md"


def test_the_page_is_what_the_command_prints(capsys: pytest.CaptureFixture[str]) -> None:
    """docs/scene-keys.md equals `arena keys --markdown`; `arena keys --markdown > docs/scene-keys.md` updates it."""
    assert main(["keys", "--markdown"]) == 0
    assert PAGE.read_text() == capsys.readouterr().out


def test_every_key_of_the_schema_has_a_row(capsys: pytest.CaptureFixture[str]) -> None:
    """`--json` has as many rows as the schema has keys; a table's name selects its rows."""
    assert main(["keys", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert len(rows) == sum(len(fields(kind)) for kind in (*TABLES.values(), *LISTS.values()))
    found = {(row["table"], row["key"]): row for row in rows}
    assert found["[camera]", "range_cm"] == {"table": "[camera]", "key": "range_cm", "type": "number", "unit": "cm",
                                             "minimum": 1, "maximum": None, "default": 150.0}  # fmt: skip
    assert main(["keys", "lamps", "--json"]) == 0
    assert {row["table"] for row in json.loads(capsys.readouterr().out)} == {"[[lamps]]"}


def test_an_unknown_table_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """An unknown table ends with status 2 and the known ones."""
    assert main(["keys", "wheels"]) == 2
    assert "there is no table 'wheels'; known: arena, marks, robots" in capsys.readouterr().err
