"""The wheel and the baselines of a new project, which all worker processes of a run share; shorter measurements."""

from __future__ import annotations

import fcntl
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "tools"))
import first_steps

from openswarm.cli import main
from tests.firmware.conftest import folder_of_run


def shortened(project: Path) -> Path:
    """Return a new project after limiting its measurements to 1.1 simulated seconds.

    Each thread and the handler still run twice. The first steps (test_wheel.py) measure as long as the template says.
    """
    for file in (project / "Makefile", *project.glob("test/*.py")):
        text = file.read_text()
        assert "seconds 2.5" in text or "seconds=2.5" in text, file
        file.write_text(text.replace("seconds 2.5", "seconds 1.1").replace("seconds=2.5", "seconds=1.1"))
    return project


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
    """Return the baselines of a `shortened` new project, by their names in it; measured once per test run."""
    folder = folder_of_run(tmp_path_factory) / "new" / "robot"
    folder.parent.mkdir(exist_ok=True)
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            assert main(["new", str(folder), "--no-baselines"]) == 0
            openswarm = f"OPENSWARM={sys.executable} -m openswarm"
            subprocess.run(["make", "-s", "-C", shortened(folder), "baselines", openswarm], check=True)
    return {f"test/{file.name}": file.read_bytes() for file in folder.glob("test/*.json")}
