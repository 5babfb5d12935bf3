"""Independent client: the protocol's test-support package from npm, run by mocha."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = ("@vscode/debugadapter-testsupport@1.68", "mocha@11")


def node_modules(folder: Path) -> Path:
    """Install the npm packages in `folder` and return their path, or return EMU_DAP_NODE_MODULES if it is set.

    Skips the test if the packages cannot be installed.
    """
    given = os.environ.get("EMU_DAP_NODE_MODULES")
    if given:
        return Path(given)
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        pytest.skip("there is no node with npm (Debian packages nodejs, npm)")
    done = subprocess.run(
        [npm, "install", "--fetch-retries=0", "--no-audit", "--no-fund", "--prefix", str(folder), *PACKAGES],
        capture_output=True, text=True, timeout=HANG, check=False,
    )  # fmt: skip
    if done.returncode:
        pytest.skip(f"npm cannot install {', '.join(PACKAGES)}: {done.stderr.strip().splitlines()[-1:]}")
    return folder / "node_modules"


def mocha(modules: Path, script: Path, **environment: str) -> str:
    """Run the tests of a script, which must pass, and return the output."""
    given = {"NODE_PATH": str(modules), "EMU_PYTHON": sys.executable, "EMU_ROOT": str(ROOT), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        ["node", str(modules / "mocha" / "bin" / "mocha.js"), str(script)],
        capture_output=True, text=True, env=os.environ | given | environment, timeout=HANG, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
