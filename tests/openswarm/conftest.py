"""Fixtures: the wheel and the baselines of a new project, which all worker processes of a run share."""

from __future__ import annotations

import fcntl
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "tools"))
import first_steps

from openswarm.cli import main
from tests.firmware.conftest import folder_of_run


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the project's wheel, built once per test run."""
    folder = folder_of_run(tmp_path_factory) / "wheel"
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not list(folder.glob("*.whl")):
            folder.mkdir(exist_ok=True)
            first_steps.build_wheel(folder)
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="session")
def baselines(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the baselines that `openswarm new robot` measures, by their names in the project; measured once per test
    run."""
    folder = folder_of_run(tmp_path_factory) / "new" / "robot"
    folder.parent.mkdir(exist_ok=True)
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            assert main(["new", str(folder)]) == 0
    return {f"test/{file.name}": file.read_bytes() for file in folder.glob("test/*.json")}
