"""The kernel has fewer hardware-specific lines than the original, by each method of counting."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[3] / "firmware" / "tools" / "hardware_share.py"
sys.path.insert(0, str(SCRIPT.parent))

import hardware_share  # noqa: E402


def test_the_hardware_share_is_below_the_papers() -> None:
    """Hardware-specific lines are below 17.0 % of physical and of code lines, without I/O devices.

    The paper's value is 17.6 %, 489 physical lines.
    """
    done = subprocess.run([sys.executable, SCRIPT, "--json"], capture_output=True, text=True, check=False)
    found = json.loads(done.stdout)
    for counting in ("physical", "code"):
        assert found[counting]["share"] < 0.17, counting
        assert 10 < found[counting]["board"] < 200
    assert found["physical"]["hardware"] < 489
    assert found["physical"]["portable"] > 1_500, "the count sees the kernel"
    assert found["code"]["portable"] > 1_000
    assert done.returncode == 0


def test_both_countings_and_the_board_are_printed() -> None:
    done = subprocess.run([sys.executable, SCRIPT], capture_output=True, text=True, check=True)
    begins = ("physical lines ", "code lines ", "board set-up ", "paper ")
    assert all(line.startswith(begin) for line, begin in zip(done.stdout.splitlines(), begins, strict=True))


@pytest.mark.parametrize(
    ("name", "text", "physical", "code"),
    [
        ("a.c", "/* one\n two */\nint a; /* a */\n\n// no\nint b; // yes\n", 6, 2),
        ("a.S", "; no\n        nop     ; yes\n/* no */\n#include <x>\n", 4, 2),
    ],
)
def test_comments_and_blanks_are_no_code(tmp_path: Path, name: str, text: str, physical: int, code: int) -> None:
    file = tmp_path / name
    file.write_text(text)
    assert (hardware_share.physical(file), hardware_share.code(file)) == (physical, code)
