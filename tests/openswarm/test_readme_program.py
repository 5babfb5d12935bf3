"""The program in the README compiles without a warning and does what its comments say."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from emu.cli import main

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_program_blinks_and_drives(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The README's thread toggles the body LED, and its handler drives after the selector is turned at 0.5 s."""
    (program,) = re.findall(r"```c\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "main.c").write_text(program)
    (tmp_path / "turn.txt").write_text("0.5s selector 5\n")
    words = ["make", "-s", "-C", str(ROOT / "firmware"), f"APPS={tmp_path}", "APP=src", f"OUT={tmp_path / 'build'}",
             f"PYTHON={sys.executable}"]  # fmt: skip
    subprocess.run(words, check=True, capture_output=True)
    image = str(tmp_path / "build" / "firmware.elf")
    options = ["--seconds", "1.6", "--watch", "motors,leds", "--stimulus", str(tmp_path / "turn.txt")]
    assert main(["run", image, *options]) == 0
    seen = capsys.readouterr().err
    assert len(re.findall(r"leds (?:body|off)", seen)) >= 4, seen
    assert re.search(r"motors [1-9]\d* 0 steps in total", seen), seen
