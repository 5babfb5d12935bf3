"""Engines of the CPU tests: `engine` is each engine, `other` each engine that is compared with the plain engine."""

from __future__ import annotations

import pytest

ENGINES = ("plain", "jit")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    named = metafunc.config.getoption("--engine", default=None)
    if "engine" in metafunc.fixturenames:
        metafunc.parametrize("engine", [named] if named else ENGINES)
    if "other" in metafunc.fixturenames:
        metafunc.parametrize("other", [named] if named and named != "plain" else ENGINES[1:])
