"""One module per command of `python -m emu`; `emu.cli` documents the interface of a command module."""

from __future__ import annotations

from typing import Final

COMMANDS: Final = {
    "run": "run a firmware image and show its UART output",
    "screenshot": "run a firmware image and write the picture its camera captured",
    "disasm": "print a firmware image as assembly with symbols and source lines",
    "info": "print sections, memory use, vectors and configuration words",
    "footprint": "print ROM and RAM use of a firmware image; fit the kernel's memory equation",
    "profile": "print the CPU load by function and interrupt level in percent, from exact cycles",
    "cycles": "measure the kernel's operations in exact cycles; check them against a baseline",
    "coverage": "report which lines, branches and instructions a run executes (lcov, Cobertura)",
    "inject": "inject the faults of a campaign file and classify their outcomes",
    "debug": "debug at a prompt, or serve an editor (Debug Adapter Protocol)",
    "completion": "print a shell completion script for these commands and their options",
}
"""Name and description of every command; the module of that name has `parser()` and `run()`."""
