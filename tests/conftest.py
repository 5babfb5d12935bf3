"""Options of all tests: another folder of vectors, or a single engine."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from emu.dspic30f.engines import NAMES, make_engine
from emu.dspic30f.jit import engine as jit
from emu.machine import machine
from tests.skips import Skips
from tests.watchdog import Silence, WatchdogPlugin

COLLECT_EVERY = 100_000
"""Allocations between two garbage collections: with Python's 700, they take a tenth of the CPU time of the tests."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--vectors", default=None, help="folder with another set of semantics*.jsonl.xz and encodings.csv")
    parser.addoption("--engine", default=None, help="run what names no engine with this one only")
    parser.addoption("--allowed-skips", default=None, type=Path, help="a file; any other skip is a failure")


def pytest_configure(config: pytest.Config) -> None:
    """Turn on the machine verifier for all tests and their child processes, and register the plugins of this folder."""
    os.environ["DSPIC_VERIFY_MACHINE"] = "1"
    gc.set_threshold(COLLECT_EVERY)
    # A shell starts `make test &` with SIGINT ignored, which child processes would inherit.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    config.pluginmanager.register(WatchdogPlugin(), "watchdog")
    if not hasattr(config, "workerinput"):
        # If the environment turns byte code files off, the child processes of a run share a temporary folder of them.
        if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
            compiled = os.environ["PYTHONPYCACHEPREFIX"] = tempfile.mkdtemp(prefix="pycache-")
            config.add_cleanup(lambda: shutil.rmtree(compiled, ignore_errors=True))
        config.pluginmanager.register(Silence(config), "silence")
        config.pluginmanager.register(Skips(config.getoption("--allowed-skips")), "skips")


@pytest.fixture(autouse=True)
def own_translations() -> None:
    """Clear the native code that machines with the same program share, so that tests are independent."""
    jit._shared.clear()


@pytest.fixture(scope="session", autouse=True)
def default_engine(request: pytest.FixtureRequest) -> Iterator[None]:
    """Make `--engine NAME` the default engine of this process."""
    named = request.config.getoption("--engine")
    with pytest.MonkeyPatch.context() as patch:
        if named in NAMES:

            def make(name: str, *arguments: Any) -> Any:
                return make_engine(named if name == "auto" else name, *arguments)

            patch.setattr(machine, "make_engine", make)
        yield
