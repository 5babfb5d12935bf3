"""Where the recorded vectors are."""

from __future__ import annotations

from pathlib import Path

import pytest

VECTORS = Path(__file__).resolve().parents[3] / "shared" / "vectors"


@pytest.fixture(scope="session")
def vectors(request: pytest.FixtureRequest) -> Path:
    """The folder of vectors. One named on the command line must exist; the default may be absent."""
    named = request.config.getoption("--vectors", default=None)
    folder = Path(named) if named else VECTORS
    if not folder.is_dir():
        if named:
            pytest.fail(f"--vectors {named}: no such folder")
        pytest.skip(f"no vectors at {folder}; name a folder with --vectors")
    return folder
