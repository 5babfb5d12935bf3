"""The programs of docs/openswarm-program.md print what the page says."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

import emu

PAGE = Path(__file__).parents[3] / "docs/openswarm-program.md"
PROGRAMS = re.findall(
    r"```c\n(.*?)```\n\nIt prints[^\n]*\n\n```text\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL
)


@pytest.mark.slow
def test_every_program_prints_what_the_page_says(image: Callable[..., Path], tmp_path: Path) -> None:
    """Each program builds, runs for two seconds without a fault, and sends the text of the page on UART1."""
    assert len(PROGRAMS) == PAGE.read_text(encoding="utf-8").count("```c\n") > 5
    different = []
    for number, (program, expected) in enumerate(PROGRAMS):
        folder = tmp_path / f"program{number}"
        folder.mkdir()
        (folder / "main.c").write_text(program)
        robot = emu.load(image(folder.name, tmp_path))
        sent = bytearray()
        robot.uart[1].listen(lambda byte, _cycle, sent=sent: sent.append(byte), lazy=True)
        stop = robot.run(seconds=2)
        if (stop.fault, sent.decode()) != (None, expected):
            different.append((number, stop.reason, sent))
    assert different == []
