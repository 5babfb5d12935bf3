"""The page of the Python interfaces: `docs/tools/site.py` calls `page`, mkdocstrings fills it from docstrings."""

from __future__ import annotations

from typing import Final

MODULES: Final = (
    "emu",
    "emu.api",
    "emu.instruments.arrivals",
    "emu.machine.machine",
    "emu.machine.fault",
    "emu.boards.epuck.board",
    "emu.boards.epuck.exchange",
    "emu.debug.history",
    "emu.host.paths",
    "emu.host.exit_status",
    "openswarm.testing.plugin",
    "openswarm.testing.robot",
    "arena.env",
    "arena.scene.schema",
    "arena.experiments",
    "arena.metrics",
    "arena.trial.record",
)
"""Public modules; tests/docs/test_api_examples.py runs their examples."""
_OPTIONS: Final = "    options:\n      heading_level: 3\n      show_root_heading: false\n"


def page() -> str:
    """Return the page: a section for each module."""
    sections = "".join(f"## {name}\n\n::: {name}\n{_OPTIONS}\n" for name in MODULES)
    return f"# Python interfaces\n\n{sections}"
