"""The wheel: its contents, reproducible bytes, and the first steps of a new user."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from emu.host import paths

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs" / "tools"))
import first_steps  # noqa: E402

pytestmark = [
    pytest.mark.skipif(shutil.which("git") is None, reason="no git here (Debian package git)"),
    pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a clone: git cannot tell what belongs to the project"),
]


@pytest.mark.slow
def test_the_wheel_holds_everything_and_repeats(wheel, tmp_path):
    """The wheel contains kernel, headers, run-time library, scenes, template and licence, but no build output.

    Building it twice gives the same bytes.
    """
    assert first_steps.build_wheel(tmp_path).read_bytes() == wheel.read_bytes()
    with zipfile.ZipFile(wheel) as content:
        names = set(content.namelist())
        metadata = content.read(next(name for name in names if name.endswith("/METADATA"))).decode()
    tracked = subprocess.run(["git", "ls-files", "firmware"], cwd=ROOT, capture_output=True, text=True, check=True)
    kernel = {name for name in tracked.stdout.split() if not name.endswith(".gitignore")}
    assert {f"openswarm/{name}" for name in kernel} == {
        name for name in names if name.startswith("openswarm/firmware/")
    }
    for part in ("emu", "toolchain", "arena", "openswarm"):
        assert f"{part}/py.typed" in names
    assert {
        "arena/scenes/clustering.toml",
        "toolchain/include/xc.h",
        "toolchain/runtime/crt0.s",
        "arena/replay/page_files/page.html",
    } <= names
    assert {"openswarm/cmake/openswarm.cmake", "openswarm/template/src/main.c", "openswarm/template/gitignore"} <= names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert "License-Expression: MIT" in metadata
    assert not [
        name for name in names if "/build/" in name or name.endswith((".elf", ".pyc")) or name.startswith("tests")
    ]


@pytest.mark.slow
def test_the_first_steps_say_what_happens(wheel, tmp_path):
    """docs/first-steps.md works from the wheel in an empty folder with an empty HOME, and creates files only there.

    Only the caches are those of all tests: the run-time library and compiled Python modules.
    """
    script = ROOT / "docs" / "tools" / "first_steps.py"
    words = [sys.executable, str(script), "--check", "--wheel", str(wheel), "--cache", str(paths.cache()),
             "--keep", str(tmp_path / "first-steps")]  # fmt: skip
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
