"""Folders of shared helper modules, and a fixture of the emulator's tests: the folder of recorded vectors."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).with_name(folder)) for folder in ("cpu", "jit", "chips", "loader", "cli")]
VECTORS = Path(__file__).resolve().parents[1] / "vectors"


@pytest.fixture(scope="session")
def vectors(request: pytest.FixtureRequest) -> Path:
    """Return the folder of recorded vectors: ``tests/vectors``, or the one in ``--vectors``."""
    named = request.config.getoption("--vectors", default=None)
    folder = Path(named) if named else VECTORS
    if not folder.is_dir():
        pytest.fail(f"--vectors {named}: no such folder" if named else f"{VECTORS} is missing from this checkout")
    return folder
