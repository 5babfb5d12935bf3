"""C programs of this folder, built for the host with sanitizers."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.watchdog import HANG

HERE = Path(__file__).parent
OPENSWARM = HERE.parents[2] / "firmware" / "openswarm"


def run_on_host(program: str, folder: Path, *words: str | Path) -> subprocess.CompletedProcess[str]:
    """Build a program of this folder with further words of the compiler, run it and return the finished process."""
    if shutil.which("gcc") is None:
        pytest.skip("the host tests of updates are built with gcc, which is not installed (Debian package gcc)")
    folders = ("include", "hal", "kernel", "io", "io/update", "port/posix", "board/host")
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"]
    command = ["gcc", "-std=gnu99", "-O1", "-g", "-Wall", "-Wextra", "-Werror", *sanitizers]
    command += [f"-I{OPENSWARM / name}" for name in folders]
    out = folder / program
    subprocess.run([*command, str(HERE / f"{program}.c"), *map(str, words), "-o", str(out)], check=True)
    return subprocess.run([out], capture_output=True, text=True, check=False, timeout=HANG)


def on_host(program: str, folder: Path, words: Sequence[str | Path] = ()) -> str:
    """Build and run a program of this folder; return its output."""
    done = run_on_host(program, folder, *words)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
