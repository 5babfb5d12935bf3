"""The blocks of the README: its commands run as printed in a fresh shell, its program does what its comments say."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from emu.cli import main
from emu.host import paths

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MAKE, PROJECT = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
"""The two blocks of commands."""
TURN = "0.5s selector 5\n"
"""The stimulus of the README's program."""


def in_fresh_shell(script: str, folder: Path, home: Path) -> subprocess.CompletedProcess[str]:
    """Run a script as a user does who has just opened a terminal: no variables but HOME, PATH and the test's cache."""
    clean = {"HOME": str(home), "PATH": "/usr/local/bin:/usr/bin:/bin", "OPENSWARM_CACHE": str(paths.cache())}
    words = ["bash", "-ec", script]
    return subprocess.run(words, cwd=folder, env=clean, capture_output=True, text=True, check=False)


def test_every_make_target_of_the_readme_exists(tmp_path: Path) -> None:
    """`make -n` accepts each line of the first block; the commands themselves install packages and take minutes."""
    lines = [line.partition("#")[0].strip() for line in MAKE.splitlines()]
    assert lines == ["make run", "make arena", "make check"]
    named = set(re.findall(r"`make (\w+)`", README + MAKE))
    script = "\n".join(f"make -n {target}" for target in sorted(named | {line.split()[1] for line in lines}))
    done = in_fresh_shell(script, ROOT, tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_project_of_the_readme_runs(tmp_path: Path) -> None:
    """The second block, in an empty folder whose `.venv` is the environment of the tests."""
    if not (Path(sys.prefix) / "bin" / "activate").exists():
        pytest.skip("the tests do not run in a virtual environment")
    (tmp_path / ".venv").symlink_to(sys.prefix)
    done = in_fresh_shell(PROJECT, tmp_path, tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "build/myrobot/build/firmware.elf").exists()
    assert "hello from myrobot" in done.stdout


@pytest.mark.slow
def test_the_program_blinks_and_drives(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The README's thread toggles the body LED, and its handler drives after the selector is turned at 0.5 s, as the
    README shows."""
    (program,) = re.findall(r"```c\n(.*?)```", README, re.DOTALL)
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "main.c").write_text(program)
    (tmp_path / "turn.txt").write_text(TURN)
    words = ["make", "-s", "-C", str(ROOT / "firmware"), f"APPS={tmp_path}", "APP=src", f"OUT={tmp_path / 'build'}",
             f"PYTHON={sys.executable}"]  # fmt: skip
    subprocess.run(words, check=True, capture_output=True)
    image = str(tmp_path / "build" / "firmware.elf")
    options = ["--seconds", "1.6", "--watch", "motors,leds", "--stimulus", str(tmp_path / "turn.txt")]
    assert main(["run", image, *options]) == 0
    seen = capsys.readouterr().err
    assert len(re.findall(r"leds (?:body|off)", seen)) >= 4, seen
    assert re.search(r"motors [1-9]\d* 0 steps in total", seen), seen
    build, stimulus, command, *printed = re.findall(r"```text\n(.*?)```", README, re.DOTALL)[0].splitlines()
    assert build == "$ make -s -C build/myrobot"
    assert stimulus == f"$ echo '{TURN.strip()}' >turn.txt"
    assert command.startswith("$ emu run build/myrobot/build/firmware.elf --watch leds,motors --stimulus turn.txt")
    assert printed
    assert [line for line in printed if line not in seen.splitlines()] == []
