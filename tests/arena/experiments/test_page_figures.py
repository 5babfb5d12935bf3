"""Figures that pages print beside a command equal what the command prints."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from emu.cli import main as emu
from tests.firmware.conftest import built_once

ROOT = Path(__file__).resolve().parents[3]
APPENDIX = (ROOT / "docs/experiment-appendix.md").read_text(encoding="utf-8")


def row(title: str) -> list[str]:
    """Return the cells of the appendix's row whose title contains a text: OpenSwarm, bare."""
    found = re.search(rf"^\| [^|]*{re.escape(title)}[^|]*\| ([^|]*) \| ([^|]*) \|$", APPENDIX, re.MULTILINE)
    assert found is not None, title
    return [found[1], found[2]]


@pytest.mark.slow
def test_the_cpu_load_is_the_measured_one(
    tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    """`emu profile` of four seconds prints the CPU loads of the appendix, for OpenSwarm and for the bare loop."""
    found = []
    for app in ("clustering", "clustering-bare"):
        image = built_once(tmp_path_factory, app)
        assert emu(["profile", str(image), "--selector", "8", "--skip", "1", "--seconds", "4"]) == 0
        busy = re.search(r"^busy .* ([\d.]+) %$", capsys.readouterr().out, re.MULTILINE)
        assert busy is not None
        found.append(f"{float(busy[1]):.2f} %")
    assert found == row("every cycle counted")


@pytest.mark.slow
def test_the_reaction_times_are_the_measured_ones(capsys: pytest.CaptureFixture[str]) -> None:
    """`arena reaction --frames 300` prints the times of the appendix, and no frame is missed."""
    from arena.cli import main as arena

    assert arena(["reaction", "--frames", "300"]) == 0
    rows = re.findall(r"^\| (?:openswarm|bare) \| (.*) \|$", capsys.readouterr().out, re.MULTILINE)
    cells = [line.split(" | ") for line in rows]
    assert [one[1] for one in cells] == row("to the new speed: median")
    assert [one[2] for one in cells] == row("99 % of the changes")
    assert [f"{one[3].removesuffix(' µs')}, {one[4]}" for one in cells] == row("least, most")
    assert [one[5] for one in cells] == ["0 of 300", "0 of 300"]


def test_the_size_of_a_port_is_the_counted_one() -> None:
    """docs/porting.md states the lines that firmware/tools/hardware_share.py counts."""
    command = [sys.executable, str(ROOT / "firmware/tools/hardware_share.py")]
    counted = re.search(
        r"physical lines (\d+) of", subprocess.run(command, capture_output=True, text=True, check=False).stdout
    )
    page = (ROOT / "docs/porting.md").read_text(encoding="utf-8")
    stated = re.search(r"a port without the hardware watchdog is (\d+) lines", page)
    assert counted is not None
    assert stated is not None
    assert stated[1] == counted[1]
