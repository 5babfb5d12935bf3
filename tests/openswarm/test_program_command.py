"""The command `openswarm`, and common features of the four command lines.

They are help with examples, versions, completion and exit statuses.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib import import_module
from importlib.metadata import requires, version
from pathlib import Path

import pytest

import arena.cli
from arena.commands import COMMANDS as ARENA
from emu.host import exit_status, paths
from emu.host.installation import install_command
from openswarm.cli import COMMANDS, command, main
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = ("emu", "toolchain", "arena", "openswarm")


def run_command(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command line in its own process."""
    return subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, timeout=HANG, check=False,
                          cwd=ROOT, env=os.environ | environment)  # fmt: skip


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_program_tells_its_version_and_helps_with_an_example(program):
    assert run_command(program, "--version").stdout == f"{program} {version('openswarm')}\n"
    told = run_command(program, "--help")
    assert (told.returncode, "example: " in told.stdout) == (0, True)
    assert run_command(program, "no-such-command").returncode == exit_status.BAD_INPUT


@pytest.mark.slow
@pytest.mark.parametrize("program", PROGRAMS)
def test_every_program_completes_itself_in_bash(program, tmp_path):
    """The completion script of every program returns the commands to bash."""
    script = run_command(program, "completion", "bash").stdout
    (tmp_path / "script").write_text(script)
    asked = f'source {tmp_path}/script; COMP_WORDS=({program} comp); COMP_CWORD=1; $(complete -p {program} |' \
            f" sed 's/.*-F \\([^ ]*\\).*/\\1/'); echo \"${{COMPREPLY[@]}}\""  # fmt: skip
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=False)
    assert "completion" in done.stdout.split(), (done.stdout, done.stderr)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name):
    told = run_command("openswarm", name, "--help")
    assert told.returncode == 0
    assert f"example: openswarm {name}" in told.stdout or "$(openswarm path" in told.stdout
    assert command(name).parser().prog == f"openswarm {name}"


def test_a_reader_that_goes_away_is_no_failure():
    pipe = f"{sys.executable} -m openswarm completion bash | head -c 1"
    done = subprocess.run(pipe, shell=True, cwd=ROOT, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_cache_is_where_the_environment_says(monkeypatch, tmp_path):
    monkeypatch.setenv("OPENSWARM_CACHE", str(tmp_path / "own"))
    assert paths.native_code() == tmp_path / "own" / "jit"
    monkeypatch.delenv("OPENSWARM_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert paths.cache() == tmp_path / "xdg" / "openswarm"


def test_a_command_may_have_a_cache_of_its_own(monkeypatch, tmp_path):
    """`--cache DIR` sets the cache of a command and of the processes that it starts."""
    monkeypatch.setenv("OPENSWARM_CACHE", str(tmp_path))
    for number, module in enumerate(("emu.commands.run", "emu.commands.profile", "arena.commands.run")):
        folder = tmp_path / str(number)
        options = import_module(module).parser().parse_args(["x", "--cache", str(folder)])
        assert options.cache == paths.cache() == folder
        assert os.environ["OPENSWARM_CACHE"] == str(folder)


def test_clean_takes_what_is_ours_and_nothing_else(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("OPENSWARM_CACHE", str(tmp_path))
    for folder, size in ((paths.native_code() / "ab", 10), (paths.images() / "hello", 20), (tmp_path / "mine", 5)):
        folder.mkdir(parents=True)
        (folder / "file").write_bytes(bytes(size))
    assert main(["clean", "--dry-run", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["kinds"]["native code"] == {"files": 1, "bytes": 10}
    assert paths.native_code().exists()
    assert main(["clean"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]
    assert main(["clean", "--cache", str(tmp_path / "nowhere")]) == 0


def test_doctor_names_what_a_missing_program_disables(tmp_path):
    """`openswarm doctor` with an empty PATH reports every program as missing, and only make as required."""
    done = run_command("openswarm", "doctor", "--json", PATH=str(tmp_path))
    told = json.loads(done.stdout)
    assert done.returncode == exit_status.FAULT
    lacking = {one["name"]: one for one in told["findings"] if not one["found"]}
    assert lacking["make"]["is_needed"]
    assert lacking["cmake"]["remedy"] == "Debian package cmake"
    assert not any(one["found"] for one in told["findings"] if one["kind"] == "program")
    packages = {one["name"] for one in told["findings"] if one["kind"] == "package"}
    assert packages == {re.match(r"[\w-]+", line)[0] for line in requires("openswarm") if "extra ==" not in line} | {
        "pytest"
    }


def test_doctor_tries_compiler_and_emulator():
    done = run_command("openswarm", "doctor", "--try")
    assert done.returncode == 0, done.stdout
    assert re.search(r"ok +compile and run +works", done.stdout)


@pytest.mark.slow
def test_the_arena_imports_what_its_command_needs():
    """`arena --version` imports no library of the extra, and `arena run --help` none of statistics or figures; the
    list of commands has the first lines of their descriptions."""
    code = "import sys, arena.cli; arena.cli.main([{}]); print(*(name for name in ({}) if name in sys.modules))"
    for words, libraries in (
        ("'--version'", "'numpy', 'scipy', 'pymunk', 'matplotlib'"),
        ("'run', '--help'", "'scipy.stats', 'matplotlib', 'pyarrow'"),
    ):
        done = subprocess.run([sys.executable, "-c", code.format(words, libraries)], cwd=ROOT, text=True, check=True,
                              capture_output=True)  # fmt: skip
        assert done.stdout.endswith("\n\n"), done.stdout[-200:]
    first_lines = {name: arena.cli.command(name)[0].description.partition("\n")[0].rstrip(".") for name in ARENA}
    assert {name: line[0].lower() + line[1:] for name, line in first_lines.items()} == ARENA


def test_the_arena_without_its_extra_names_it(tmp_path):
    """Without its extra, `arena` prints one line that names the extra and exits with 2, whichever package is
    missing."""
    for package in ("pymunk", "scipy"):
        (tmp_path / package).mkdir()
        (tmp_path / package / f"{package}.py").write_text(f"raise ModuleNotFoundError(name={package!r})\n")
        done = run_command("arena", "compare", "x", "y", PYTHONPATH=str(tmp_path / package))
        assert done.returncode == exit_status.BAD_INPUT
        assert done.stderr == f"arena: {package} is not installed: {install_command('arena')}\n"


def test_the_archiver_does_what_cmake_asks(tmp_path):
    """`ar qc` and `ranlib` work as CMake calls them; a member that is appended twice is stored twice, as by GNU ar."""
    (tmp_path / "a.s").write_text(".global _a\n_a: return\n")
    bin_folder = Path(sys.executable).parent
    for words in ("as a.s -o a.o", "ar qc x.a a.o", "ar q x.a a.o", "ranlib x.a"):
        name, *rest = words.split()
        done = subprocess.run(
            [bin_folder / f"dspic-{name}", *rest], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")
    done = subprocess.run(
        [bin_folder / "dspic-ar", "t", "x.a"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["a.o", "a.o"]
    told = subprocess.run([bin_folder / "dspic-nm", "--version"], capture_output=True, text=True, check=False)
    assert told.stdout == f"dspic-nm (openswarm) {version('openswarm')}\n"


def test_every_file_that_users_link_names_its_licence():
    for folder in ("firmware/openswarm", "toolchain/runtime", "toolchain/include"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".c", ".h", ".S", ".s", ".inc", ".ld"):
                assert "SPDX-License-Identifier: MIT" in path.read_text(encoding="utf-8").splitlines()[0], path
