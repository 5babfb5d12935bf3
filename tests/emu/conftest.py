"""A fixture of the emulator's tests: the folder of recorded vectors."""

from __future__ import annotations

from pathlib import Path

import pytest

VECTORS = Path(__file__).resolve().parents[1] / "vectors"


@pytest.fixture(scope="session")
def vectors(request: pytest.FixtureRequest) -> Path:
    """Return the folder of recorded vectors: ``tests/vectors``, or the one in ``--vectors``."""
    named = request.config.getoption("--vectors", default=None)
    folder = Path(named) if named else VECTORS
    if not folder.is_dir():
        pytest.fail(f"--vectors {named}: no such folder" if named else f"{VECTORS} is missing from this checkout")
    return folder
