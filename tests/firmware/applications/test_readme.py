"""Check that the examples, commands and paths in the project's README and in its tour work."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
README = "".join((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/tour.md"))


def test_the_python_example_runs(image):
    example = re.search(r"```python\n(.*?)```", README, re.DOTALL)[1]
    code = example.replace('"firmware.elf"', repr(str(image("listing1"))))
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert lines[0].startswith("main at ")
    assert re.fullmatch(r"limit 0x[0-9a-f]+ 7 \[.*'main'.*\]", lines[-1])


@pytest.mark.parametrize("command", sorted(set(re.findall(r"-m (emu \w+|toolchain \w+)", README))))
def test_every_command_it_shows_exists(command):
    done = subprocess.run(
        [sys.executable, "-m", *command.split(), "--help"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0
    assert "usage" in done.stdout.lower()


def test_every_place_it_points_to_exists():
    for name in re.findall(r"`((?:firmware|toolchain|emu|tests|bench|docs)/[\w./-]*)`", README):
        if "build/" not in name:
            assert (ROOT / name).exists(), name
