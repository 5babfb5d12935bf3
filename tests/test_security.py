"""SECURITY.md: its inputs name tests that exist, its limits are those of the code; tests of inputs without a module."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path

import pytest

from toolchain.cli import main
from toolchain.elf.archive import ArchiveMember, archive_bytes

ROOT = Path(__file__).resolve().parents[1]


UNITS = {"": 1, " s": 1, " KiB": 1 << 10, " MiB": 1 << 20, " GiB": 1 << 30}


def table(heading: str) -> list[str]:
    """Return the rows of the table below a heading."""
    text = (ROOT / "SECURITY.md").read_text().partition(f"{heading}\n")[2].partition("\n## ")[0]
    return [line for line in text.splitlines() if line.startswith("| ")][1:]


def named_tests() -> list[tuple[str, str]]:
    """Return file and function of the tests in the table "Inputs and outcomes"."""
    rows = table("## Inputs and outcomes")
    found = [re.fullmatch(r".*\| `([\w/]+\.py)::(\w+)` \|", row) for row in rows]
    assert all(found), [row for row, match in zip(rows, found, strict=True) if not match]
    return [(match[1], match[2]) for match in found if match]


def test_every_line_of_the_table_names_a_test():
    named = named_tests()
    assert len(named) > 20
    assert len(set(named)) == len(named)
    for file, name in named:
        tree = ast.parse((ROOT / "tests" / file).read_text())
        assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, (file, name)


def test_the_limits_are_those_of_the_code():
    rows = table("## Limits")
    assert len(rows) > 15
    for row in rows:
        limit = re.fullmatch(r"\| [^|]+ \| ([\d,]+)( s| [KMG]iB|) \| `([\w.]+)\.(\w+)` \|", row)
        assert limit, row
        number, unit, module, name = limit.groups()
        assert getattr(import_module(module), name) == int(number.replace(",", "")) * UNITS[unit], row


@pytest.mark.parametrize("name", ["../out", "/tmp/out", "folder/out", ".."])
def test_members_of_archives_stay_in_the_folder(name, tmp_path, monkeypatch, capsys):
    """`ar x` refuses a member with a folder in its name before it writes any member."""
    inside = tmp_path / "inside"
    inside.mkdir()
    monkeypatch.chdir(inside)
    archive = tmp_path / "hostile.a"
    archive.write_bytes(archive_bytes([ArchiveMember("fine.o", b"1"), ArchiveMember(name, b"2")]))
    assert main(["ar", "x", str(archive)]) == 2
    assert "is not a plain file name" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["hostile.a", "inside"]
