"""docs/accuracy.md lists every fact that the code marks as unverified on silicon."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "accuracy.md").read_text(encoding="utf-8")


def sources():
    for folder in ("emu", "toolchain", "firmware", "arena", "openswarm"):
        for suffix in ("py", "c", "h", "s", "S"):
            yield from (path for path in (ROOT / folder).rglob(f"*.{suffix}") if "build" not in path.parts)


def test_every_file_with_an_unverified_choice_is_on_the_page():
    """Every file with the mark `UNVERIFIED` is named in docs/accuracy.md."""
    missing = [
        str(path.relative_to(ROOT))
        for path in sources()
        if "UNVERIFIED" in path.read_text(encoding="utf-8", errors="replace") and path.name not in PAGE
    ]
    assert not missing


def test_every_file_the_page_names_exists():
    names = re.findall(r"`((?:emu|isa|toolchain|firmware|arena|docs|tests)/[\w./-]+)", PAGE)
    assert len(names) > 40
    for name in names:
        path = ROOT / ("emu/dspic30f/" + name if name.startswith("isa/") else name)
        assert path.exists(), name


def test_all_open_points_of_the_core_have_a_row():
    """docs/accuracy.md has a row for each of the open points 1 to 28 of isa.md §22."""
    table = PAGE.split("## Open points of the core")[1].split("Beyond that list")[0]
    assert [int(number) for number in re.findall(r"^\| (\d+) \|", table, re.MULTILINE)] == list(range(1, 29))
