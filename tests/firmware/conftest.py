"""Fixtures that build firmware images, each once per test run, in a temporary folder.

Images share the IR of kernel and drivers in the cache (`toolchain cc -fcache-ir`).
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
TARGET_APPS = Path(__file__).parent / "target"

Build = Callable[..., Path]


def run_make(folder: Path, *words: str) -> None:
    """Run `make` once; on failure the test fails with the compiler's messages."""
    command = ["make", "-s", "-C", str(folder), *words]
    environment = {**os.environ, "MAKEFLAGS": ""}
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr


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
            run_make(folder, f"OUT={out}", *words, str(out / product))
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
