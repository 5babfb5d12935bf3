"""`openswarm new`: the project builds with make and with CMake, and its test fails if the firmware is faulty."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from openswarm.cli import main
from openswarm.commands.new import measure
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("new") / "my-robot"
    assert main(["new", str(folder), "--no-baselines"]) == 0
    return folder


def test_baselines_that_cannot_be_built_are_reported_in_one_line(tmp_path, capsys):
    (tmp_path / "Makefile").write_text("baselines:\n\t@echo no compiler >&2; exit 3\n")
    measure(tmp_path)
    said = capsys.readouterr().err
    assert said == "openswarm new: the baselines are missing; `make baselines` writes them: no compiler\n"


def run_command(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    return subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, timeout=HANG, check=False)


def test_it_has_its_name_everywhere_and_no_hole(project):
    names = {path.relative_to(project).as_posix() for path in project.rglob("*") if path.is_file()}
    assert {
        "Makefile", "CMakeLists.txt", "src/main.c", "test/test_my-robot.py", ".vscode/tasks.json", ".gitignore",
    } <= names  # fmt: skip
    assert not [path for path in project.rglob("*") if path.is_file() and "@PROJECT@" in path.read_text()]


@pytest.mark.slow
def test_make_builds_and_its_test_finds_what_is_wrong(project):
    """The project's test of the greeting fails if the firmware is faulty; a mistake in the C source is reported in the
    format of VS Code's problem matcher. The first steps (test_wheel.py) run all tests of the correct firmware."""
    source = project / "src" / "main.c"
    right = source.read_text()
    source.write_text(right.replace("Sys_Sleep(1000)", "Sys_Sleep(900)", 1))
    assert run_command(project, "make").returncode == 0
    # settings of an enclosing folder, such as a checkout of OpenSwarm, must not affect the project's tests
    (project.parent / "pyproject.toml").write_text('[tool.pytest.ini_options]\naddopts = "--of-another-project"\n')
    done = run_command(project, "python", "-m", "pytest", "-q", "-k", "greets")
    assert (done.returncode, "1 failed" in done.stdout) == (1, True), done.stdout
    source.write_text(right.replace("Sys_Sleep(1000)", "Sys_Slep(1000)", 1))
    done = run_command(project, "make")
    assert done.returncode == 2
    task = json.loads((project / ".vscode" / "tasks.json").read_text())["tasks"][0]
    pattern = re.compile(task["problemMatcher"]["pattern"]["regexp"])
    errors = [found for line in done.stderr.splitlines() if (found := pattern.match(line)) and found[4] == "error"]
    assert errors
    assert (project / errors[0][1]).samefile(source)
    assert errors[0][2] == str(right.splitlines().index("        Sys_Sleep(1000);") + 1)
    source.write_text(right)


def test_the_editor_finds_the_line_of_a_fault(project):
    """The problem matcher of the project's tasks finds the line of faults as printed in docs/debugging.md and
    docs/tour.md."""
    task = json.loads((project / ".vscode" / "tasks.json").read_text())["tasks"][1]
    pattern = re.compile(task["problemMatcher"]["pattern"]["regexp"])
    pages = [(ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("debugging.md", "tour.md")]
    lines = [line for page in pages for line in page.splitlines() if line.startswith("emu run: firmware fault")]
    found = [pattern.match(line) for line in lines]
    assert [(one[2], one[3]) for one in found] == [("main.c", "8"), ("docs/examples/bad.c", "7")]


@pytest.mark.parametrize(
    ("name", "message"), [("2fast", "cannot be"), ("a b/c", "a space in its path"), ("_x", "cannot be")]
)
def test_what_cannot_be_a_project_is_refused(name, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["new", name]) == 2
    assert message in capsys.readouterr().err
    (tmp_path / "there").mkdir()
    assert main(["new", "there"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
