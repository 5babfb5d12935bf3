"""Fixtures that build firmware images, each once per test run, in a temporary folder.

Images share the IR of kernel and drivers in the cache (`toolchain cc -fcache-ir`). The firmware's Makefile says how to
build them; its compiler commands run in this process, which saves half of a build's CPU time.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import io
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.watchdog import HANG
from toolchain.driver import driver

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
TARGET_APPS = Path(__file__).parent / "target"

Build = Callable[..., Path]


COMPILE = f"PYTHONPATH={ROOT} {sys.executable} -m toolchain cc "
"""Beginning of the Makefile's command that compiles and links an image for the e-puck."""


def run_make(folder: Path, *words: str) -> str:
    """Run `make` and return its output; on failure the test fails with the compiler's messages."""
    return run(["make", "-s", "-C", str(folder), *words], folder)


def run(command: list[str], folder: Path) -> str:
    """Run a command in a folder and return its output; on failure the test fails with its messages."""
    environment = {**os.environ, "MAKEFLAGS": ""}
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=HANG, check=False, env=environment
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def make_in_this_process(folder: Path, *words: str) -> None:
    """Run the commands of `make -n`, those of the compiler in this process."""
    for command in run_make(folder, "-n", *words).splitlines():
        if not command.startswith(COMPILE):
            run(["sh", "-ec", command], folder)
            continue
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), contextlib.chdir(folder):
            status = driver.main(shlex.split(command.removeprefix(COMPILE)))
        assert status == 0, said.getvalue()


def folder_of_run(factory: pytest.TempPathFactory) -> Path:
    """Return the folder that all worker processes of a test run share."""
    run = factory.getbasetemp()
    return run.parent if "PYTEST_XDIST_WORKER" in os.environ else run  # a worker's folder is inside the run's folder


def make_once(factory: pytest.TempPathFactory, name: str, product: str, folder: Path, *words: str) -> Path:
    """Make a product in a folder OUT once for all worker processes of a test run, and return its path."""
    out = folder_of_run(factory) / f"{name}-{hashlib.sha256(repr(words).encode()).hexdigest()[:16]}"
    with out.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (out / product).exists():
            make = make_in_this_process if folder == FIRMWARE else run_make
            make(folder, f"OUT={out}", *words, str(out / product))
    return out / product


def built_once(factory: pytest.TempPathFactory, app: str, *words: str) -> Path:
    """Build an application for the e-puck once for all worker processes of a test run."""
    return make_once(factory, app, "firmware.elf", FIRMWARE, f"APP={app}", f"PYTHON={sys.executable}", *words)


@pytest.fixture(scope="session")
def image(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """Function that builds an application for the e-puck: `image("listing1")`; `apps=` names another source folder."""

    def build(app: str, apps: Path | None = None, *words: str) -> Path:
        folder = [f"APPS={os.path.relpath(apps, FIRMWARE)}"] if apps else []
        return built_once(tmp_path_factory, app, *folder, *words)

    return build


@pytest.fixture(scope="session")
def host_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the kernel's host tests for the POSIX port with sanitizers."""
    if shutil.which("gcc") is None:
        pytest.skip("the host tests of the kernel are built with gcc, which is not installed (Debian package gcc)")
    return make_once(tmp_path_factory, "host", "kernel_tests", Path(__file__).parent / "host", "-j2")
