"""Every test of the CPU runs on every engine; those that compare engines take the plain one and each `other`."""

from __future__ import annotations

import pytest

ENGINES = ("plain", "jit")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    named = metafunc.config.getoption("--engine", default=None)
    if "engine" in metafunc.fixturenames:
        metafunc.parametrize("engine", [named] if named else ENGINES)
    if "other" in metafunc.fixturenames:
        metafunc.parametrize("other", [named] if named and named != "plain" else ENGINES[1:])
