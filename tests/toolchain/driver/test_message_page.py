"""The page of compiler messages: each of its mistakes has the message that the page states."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build

PAGE = Path(__file__).parents[3] / "docs" / "compiler-messages.md"
ROW = re.compile(r"^\| (`.*`) \| `(.+)` \| (.+) \|$", re.MULTILINE)
ROWS = [
    (source.strip("`").replace("`<br>`", "\n") + "\n", message, re.findall(r"`(-O\w)`", cure))
    for source, message, cure in ROW.findall(PAGE.read_text())
]
"""Source, message, and the options that the cure names."""
COLUMN = re.compile(r"^((?:\S*/)?main\.c:\d+):\d+:", re.MULTILINE)


def test_the_page_has_forty_mistakes() -> None:
    """No row of the tables is lost in parsing, and no mistake occurs twice."""
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    assert len(lines) == len(ROWS) == len({source for source, _, _ in ROWS}) >= 40


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "message", "options"), ROWS, ids=[str(number) for number in range(1, len(ROWS) + 1)]
)
def test_a_mistake_has_the_message_of_the_page(
    source: str, message: str, options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The compiler prints the stated message for each mistake. An error ends the build, a warning does not."""
    monkeypatch.chdir(tmp_path)
    Path("main.c").write_text(source)
    built = build([Path("main.c")], Path("x.elf"), "-Wall", *options)
    said = COLUMN.sub(r"\1:", built.messages).replace(f"{tmp_path}/", "")
    assert message in said
    if "error: " in message:
        assert built.status in (1, 2)
