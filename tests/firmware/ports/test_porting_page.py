"""docs/porting.md: its tables are those of the tree."""

from __future__ import annotations

import importlib.util
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
_spec = importlib.util.spec_from_file_location("port_files", ROOT / "docs" / "tools" / "port_files.py")
assert _spec is not None
assert _spec.loader is not None
port_files = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(port_files)


def test_the_tables_are_up_to_date() -> None:
    """Both tables are those that docs/tools/port_files.py makes from the tree: run it with --write after a change."""
    assert port_files.PAGE.read_text("utf-8") == port_files.page()


def test_the_list_has_what_a_build_needs() -> None:
    """The list names the files without which the newest port is not built or not tested."""
    assert {"firmware/Makefile", "firmware/port.mk", "tests/firmware/ports/targets.py"} <= set(port_files.naming())
