"""A new project: its baselines, CMake and make, the folders of its sources, and its workflow step by step."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
import yaml

from emu.host import installation, paths
from openswarm.cli import main
from tests.openswarm.conftest import shortened
from tests.watchdog import HANG
from toolchain.frontend.options import CcOptions

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent


def run_command(folder: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    variables = os.environ | {"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"} | environment
    return subprocess.run(words, cwd=folder, env=variables, capture_output=True, text=True, timeout=HANG, check=False)


def new(folder: Path, *words: str, baselines: dict[str, bytes] | None = None) -> Path:
    """Return a new project; with baselines it is `shortened`, because they are those of a shortened project."""
    assert main(["new", str(folder), *words, *["--no-baselines"] * (baselines is not None)]) == 0
    if baselines is not None:
        shortened(folder)
        for name, content in baselines.items():
            (folder / name).write_bytes(content)
    return folder


@pytest.mark.slow
def test_its_baselines_pass_until_a_number_grows(tmp_path, baselines):
    project = new(tmp_path / "robot", baselines=baselines)
    done = run_command(project, "make", "--no-print-directory", "--keep-going", "check")
    assert (done.returncode, done.stdout.count(": PASS: ")) == (0, 2), done.stdout + done.stderr
    source = project / "src" / "main.c"
    text = source.read_text()
    source.write_text(text.replace(
        "data->value % 2 == 0", "(data->value ^ (uint16)(Sys_Get_SystemTime() >> 9 & 2)) % 2 == 0"
    ))  # fmt: skip
    done = run_command(project, "make", "--no-print-directory", "--keep-going", "check")
    assert (done.returncode, done.stdout.count(": FAIL: ")) == (2, 2), done.stdout + done.stderr
    line = text[: text.index("data->value")].count("\n") + 1
    handler = done.stdout[done.stdout.index("handler on_beat, ") :].splitlines()
    assert f"src/main.c:{line}: Sys_Set_LED" in handler[1]
    assert run_command(project, "make", "baselines").returncode == 0
    assert run_command(project, "make", "check-cycles").returncode == 0
    (project / "test" / "cycles.json").write_text("{}")
    done = run_command(project, "make", "check-cycles")
    assert done.returncode == 2
    assert "cycles.json: schema: expected" in done.stderr


def test_below_a_checkout_the_sources_are_named_from_the_project_on(tmp_path):
    project = new(tmp_path / "robot", "--no-baselines")
    # as if the project lay in a checkout
    words = ("FIRMWARE=" + str(tmp_path / "firmware"), "--eval", "recorded: ; @echo $(RECORDED)")
    done = run_command(project, "make", "--no-print-directory", *words, "recorded")
    maps = CcOptions(clang=done.stdout.split()).prefix_map
    source = str(project / "src" / "main.c")
    old, name = [pair for pair in maps if source.startswith(pair[0])][-1]
    assert (len(maps), name + source.removeprefix(old)) == (2, "src/main.c")


def test_without_pytest_make_test_says_how_to_install_it(tmp_path):
    project = new(tmp_path / "robot", "--no-baselines")
    bare = tmp_path / "python"
    bare.write_text(f'#!/bin/sh\nexec {sys.executable} -I -S "$@"\n')  # without installed packages
    bare.chmod(0o755)
    done = run_command(project, "make", "test", f"PYTHON={bare}", "HEX=")
    assert (done.returncode, done.stderr.splitlines()[0]) == (2, "make test needs pytest: pip install pytest")


def test_without_make_the_baselines_are_missing_with_a_reason(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    new(tmp_path / "robot")
    assert "the baselines are missing; `make baselines` writes them: make is not installed" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cmake") is None, reason="no CMake here (Debian package cmake)")
def test_make_and_cmake_build_the_same_bytes(tmp_path):
    """Both build equal images with drivers, definitions and sub-folders, and write equal compile_commands.json."""
    project = new(tmp_path / "robot", "--no-baselines")
    source, drivers = project / "src" / "main.c", project / "src" / "drivers" / "near"
    drivers.mkdir(parents=True)
    (drivers / "near.c").write_text('#include "near.h"\n#include <analog.h>\nint near(void) { return LIMIT; }\n')
    (drivers / "near.h").write_text("int near(void);\n")
    (project / "src" / "app.mk").write_text("DEVICES := analog\noverride DEFINES += -DLIMIT=45\n")
    text = '#include "drivers/near/near.h"\n#include <analog.h>\n' + source.read_text()
    calls = "    Sys_Start_Analog();\n    Sys_Set_LED(near(), true);\n"
    source.write_text(text.replace("    Sys_Start_Kernel();", f"{calls}    Sys_Start_Kernel();"))
    done = run_command(project, "make")
    assert done.returncode == 0, done.stderr
    for words in (("cmake", "-B", "build/cmake"), ("cmake", "--build", "build/cmake")):
        done = run_command(project, *words)
        assert done.returncode == 0, done.stdout + done.stderr
    for name in ("firmware.elf", "firmware.hex"):
        assert (project / "build" / name).read_bytes() == (project / "build" / "cmake" / name).read_bytes(), name
    tables = [json.loads((project / where / "compile_commands.json").read_text()) for where in ("build", "build/cmake")]
    assert tables[0] == tables[1]
    mine = {Path(one["file"]): one["arguments"] for one in tables[0]}
    assert {source, drivers / "near.c"} <= mine.keys()
    assert "-DLIMIT=45" in mine[drivers / "near.c"]
    lists = (project / "CMakeLists.txt").read_text()
    (project / "CMakeLists.txt").write_text(lists.replace("FOLDER src", "SOURCES src/main.c DEVICES warp-drive"))
    done = run_command(project, "cmake", "-B", "build/cmake")
    assert "DEVICES warp-drive: neither in" in " ".join(done.stderr.split())


def test_the_list_of_commands_is_written_over_no_source(tmp_path):
    source = tmp_path / "main.c"
    source.write_text("int main(void) { return 0; }\n")
    script = ROOT / "firmware" / "tools" / "compile_commands.py"
    done = run_command(tmp_path, sys.executable, str(script), "-o", "list.json", "main.c", PYTHONPATH=str(ROOT))
    assert (done.returncode, done.stderr) == (2, "expected -o FILE.json at the end, not list.json main.c\n")
    assert source.read_text() == "int main(void) { return 0; }\n"


@pytest.mark.skipif(shutil.which("git") is None or not (ROOT / ".git").exists(), reason="not a clone, or no git")
@pytest.mark.slow
def test_the_workflow_s_steps_work_offline_as_they_are_written(wheel, baselines, tmp_path):
    """Every `run` step of the workflow runs in an empty folder with an empty HOME, without a package index.

    The cache is that of all tests, which has the run-time library.
    """
    python = tmp_path / "venv" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", python.parents[1]], check=True)
    dependencies = tmp_path / "dependencies"
    dependencies.mkdir()
    for one in Path(sysconfig.get_path("purelib")).iterdir():
        if "openswarm" not in one.name and one.suffix != ".pth" and not one.name.startswith("setuptools"):
            (dependencies / one.name).symlink_to(one)
    packages = next((tmp_path / "venv" / "lib").glob("python*")) / "site-packages"
    (packages / "dependencies.pth").write_text(f"{dependencies}\n")
    project = new(tmp_path / "robot", baselines=baselines)
    (project / "wheels").mkdir()
    shutil.copy(wheel, project / "wheels" / installation.wheel_name())
    summary, home = tmp_path / "summary", tmp_path / "home"
    home.mkdir()
    job = yaml.safe_load((project / ".github" / "workflows" / "firmware.yml").read_text())["jobs"]["firmware"]
    package = job["env"]["OPENSWARM_PACKAGE"].split("'")[1]
    environment = {
        "PATH": f"{python.parent}{os.pathsep}/usr/bin{os.pathsep}/bin", "HOME": str(home), "PIP_NO_INDEX": "1",
        "OPENSWARM_PACKAGE": package, "GITHUB_STEP_SUMMARY": str(summary), "OPENSWARM_CACHE": str(paths.cache()),
        "GITHUB_BASE_REF": "main", "PYTHONPYCACHEPREFIX": os.environ.get("PYTHONPYCACHEPREFIX", str(home / "compiled")),
    }  # fmt: skip
    git = ("git", "-c", "user.name=x", "-c", "user.email=x@example.org")
    for text in ("init -q -b main", "add .", "commit -q -m x", "remote add origin .", "fetch -q origin"):
        words = text.split()
        subprocess.run([*git, *words], cwd=project, check=True, capture_output=True)
    for step in job["steps"]:
        if "run" in step:
            done = subprocess.run(
                ["bash", "-e", "-o", "pipefail", "-c", step["run"]], cwd=project, env=environment, check=False,
                capture_output=True, text=True,
            )  # fmt: skip
            assert done.returncode == 0, (step["name"], done.stdout, done.stderr)
    text = summary.read_text()
    assert text.count("PASS: none of") == 4
    assert text.count("| passed |") == 4
    assert "## Base against head" in text


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        (None, f"./{installation.wheel_name()}[arena]"),
        ("/home/x/openswarm", "/home/x/openswarm[arena]"),
        ("git+https://example.org/openswarm@1a2b", "openswarm[arena] @ git+https://example.org/openswarm@1a2b"),
    ],
)
def test_the_address_of_an_installation_is_repeated(address, expected):
    assert installation.requirement("arena", address) == expected


def test_no_other_place_spells_the_installation():
    """No message, template or page tells users to install the package from an index, where it does not exist."""
    folders = [ROOT / name for name in ("emu", "toolchain", "arena", "openswarm", "docs", "editors")]
    spellings = ("pip install openswarm", "pip install 'openswarm[", 'pip install "openswarm[')
    files = [path for folder in folders for path in folder.rglob("*") if path.suffix in (".py", ".md", ".yml", "")]
    texts = {path: path.read_text(encoding="utf-8", errors="replace") for path in files if path.is_file()}
    texts[ROOT / "action.yml"] = (ROOT / "action.yml").read_text()
    assert [path for path, text in texts.items() if any(words in text for words in spellings)] == []
