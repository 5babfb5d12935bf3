"""Builds firmware for the tests, each image once per run, in a temporary folder."""

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
from watchdog import HANG

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
TARGET_APPS = Path(__file__).parent / "target"

Build = Callable[..., Path]


def run_make(folder: Path, *words: str) -> None:
    """One `make`; fails the test with the compiler's words."""
    command = ["make", "-s", "-C", str(folder), *words]
    environment = {**os.environ, "MAKEFLAGS": ""}
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr


def built_once(factory: pytest.TempPathFactory, app: str, *words: str) -> Path:
    """An application's image for the e-puck, built once for all processes that share a run of tests."""
    run = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        run = run.parent  # a worker's own folder lies in the run's
    out = run / f"{app}-{hashlib.sha256(repr(words).encode()).hexdigest()[:16]}"
    image = out / "firmware.elf"
    with out.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not image.exists():
            run_make(FIRMWARE, f"APP={app}", f"OUT={out}", f"PYTHON={sys.executable}", *words)
    return image


@pytest.fixture(scope="session")
def image(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """`image("listing1")` builds an application for the e-puck; `apps=` names another folder of applications."""

    def build(app: str, apps: Path | None = None, *words: str) -> Path:
        folder = [f"APPS={os.path.relpath(apps, FIRMWARE)}"] if apps else []
        return built_once(tmp_path_factory, app, *folder, *words)

    return build


@pytest.fixture(scope="session")
def host_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The kernel's tests on the POSIX port, under sanitizers."""
    if shutil.which("gcc") is None:
        pytest.skip("the host tests of the kernel are built with gcc, which is not installed (Debian package gcc)")
    out = tmp_path_factory.mktemp("host")
    run_make(Path(__file__).parent / "host", "-j2", f"OUT={out}")
    return out / "kernel_tests"
