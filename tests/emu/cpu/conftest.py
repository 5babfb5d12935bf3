"""Every test of the CPU runs on every engine."""

from __future__ import annotations

import pytest

ENGINES = ("plain", "interp")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "engine" in metafunc.fixturenames:
        named = metafunc.config.getoption("--engine", default=None)
        metafunc.parametrize("engine", [named] if named else ENGINES)
