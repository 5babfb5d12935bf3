"""Unusual checkouts and environments: read-only, reached by a symbolic link, `umask 077`, no HOME, SIGINT ignored."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from arena.robots import images
from emu.host import paths
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("emu", "toolchain")
PROGRAM = """
        .include "p30F6014A.inc"
        .text
        .global __reset
__reset: bset   U1MODE, #15
        bset    U1STA, #10
        mov     #'h', w0
        mov     w0, U1TXREG
        mov     #'i', w0
        mov     w0, U1TXREG
1:      btss    U1STA, #8
        bra     1b
        mov     #20000, w1  ; long enough that the loop is translated and cached
2:      dec     w1, w1
        bra     nz, 2b
        pwrsav  #1
"""


def run(*words: object, folder: Path, root: Path = ROOT, **environment: str) -> str:
    """Run a command with the packages of `root` and return its standard output; the command must succeed."""
    surroundings = {name: value for name, value in os.environ.items() if name in ("PATH", "OPENSWARM_CACHE")}
    done = subprocess.run(list(map(str, words)), cwd=folder, env=surroundings | {"PYTHONPATH": str(root)} | environment,
                          capture_output=True, text=True, timeout=HANG, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def build_and_run(folder: Path, root: Path = ROOT, **environment: str) -> str:
    """Assemble, link and run PROGRAM in `folder` and return its UART output."""
    (folder / "main.s").write_text(PROGRAM)
    python = [sys.executable, "-m"]
    run(*python, "toolchain", "cc", "-nostdlib", "main.s", "-o", "main.elf", folder=folder, root=root, **environment)
    return run(*python, "emu", "run", "main.elf", folder=folder, root=root, **environment)


def test_commands_and_make_work_behind_a_symbolic_link(tmp_path: Path) -> None:
    """Through a symbolic link, programs are built and run, and `make` finds the firmware."""
    link = tmp_path / "link"
    link.symlink_to(ROOT, target_is_directory=True)
    (tmp_path / "work").mkdir()
    assert build_and_run(tmp_path / "work", root=link) == "hi"
    steps = run("make", "-n", "-C", link, "run", f"VENV={tmp_path / 'venv'}", folder=tmp_path)
    assert "emu run firmware.elf" in steps


def listing(folder: Path) -> dict[Path, tuple[int, int]]:
    """Return mode and time of modification of all files and folders."""
    return {path: (path.stat().st_mode, path.stat().st_mtime_ns) for path in folder.rglob("*")}


def test_a_read_only_checkout_is_not_written(tmp_path: Path) -> None:
    """Commands work in a tree without write permission and leave it unchanged (root could write it)."""
    tree, work = tmp_path / "tree", tmp_path / "work"
    work.mkdir()
    for part in PARTS:
        shutil.copytree(ROOT / part, tree / part, ignore=shutil.ignore_patterns("__pycache__"))
    for path in (*tree.rglob("*"), tree):
        path.chmod(path.stat().st_mode & ~0o222)
    before = listing(tree)
    try:
        assert build_and_run(work, root=tree, PYTHONDONTWRITEBYTECODE="1") == "hi"
        assert listing(tree) == before
    finally:
        for path in (tree, *tree.rglob("*")):
            path.chmod(path.stat().st_mode | 0o200)


def test_firmware_of_a_read_only_checkout_is_built_in_the_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`arena run` passes `make` an output folder in the cache if the firmware's folder is not writable."""
    monkeypatch.setenv("OPENSWARM_CACHE", str(tmp_path / "cache"))
    commands: list[list[str]] = []

    def make(command: list[str], **_options: object) -> subprocess.CompletedProcess[str]:
        commands.append(command)
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(images.subprocess, "run", make)
    for is_writable, folder in ((True, paths.firmware() / "build"), (False, tmp_path / "cache" / "firmware")):
        monkeypatch.setattr(images.os, "access", lambda _path, _mode, answer=is_writable: answer)
        assert images.image_for("openswarm") == folder / "clustering" / "firmware.elf"
        assert f"OUT={folder / 'clustering'}" in commands[-1]


def test_files_are_private_under_umask_077(tmp_path: Path) -> None:
    """Under `umask 077` commands work, and no other user can read what they write."""
    before = os.umask(0o077)
    try:
        (tmp_path / "work").mkdir()
        assert build_and_run(tmp_path / "work", OPENSWARM_CACHE=str(tmp_path / "cache")) == "hi"
    finally:
        os.umask(before)
    written = [path for folder in ("work", "cache") for path in (tmp_path / folder).rglob("*")]
    assert {path.name for path in written} >= {"main.elf", "jit"}
    assert [path for path in written if stat.S_IMODE(path.stat().st_mode) & 0o077] == []


def test_a_user_without_a_home_has_a_cache_for_temporary_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without HOME and an entry in the user database, as in many containers, no folder is called `~`."""

    def unknown(number: int) -> pwd.struct_passwd:
        raise KeyError(number)

    for name in ("HOME", "XDG_CACHE_HOME", "XDG_STATE_HOME", "OPENSWARM_CACHE"):
        monkeypatch.delenv(name, raising=False)
    assert paths.cache().is_absolute()
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    monkeypatch.setattr(paths.tempfile, "gettempdir", lambda: str(tmp_path))
    assert paths.cache() == tmp_path / f"openswarm-{os.getuid()}"
    assert paths.history().is_relative_to(tmp_path)


def test_commands_work_without_home(tmp_path: Path) -> None:
    """Without HOME commands work; nothing appears in the working folder but their output."""
    assert build_and_run(tmp_path, OPENSWARM_CACHE=str(tmp_path / "cache")) == "hi"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cache", "main.elf", "main.s"]


@pytest.mark.slow
def test_tests_of_interrupts_pass_although_sigint_is_ignored_at_the_start() -> None:
    """A shell starts `make test &` with SIGINT ignored; tests that interrupt child processes pass nevertheless."""
    words = [sys.executable, "-m", "pytest", "-p", "no:xdist", "-p", "no:cacheprovider", "-m", "",
             "tests/emu/cli/test_run.py::test_ctrl_c_ends_a_run_cleanly"]  # fmt: skip
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False,
                          preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))  # fmt: skip
    assert (done.returncode, "1 passed" in done.stdout) == (0, True), done.stdout
