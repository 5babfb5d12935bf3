"""One module per command of `python -m emu`; see `emu.cli` for what a command module must have."""

from __future__ import annotations

from typing import Final

COMMANDS: Final = {
    "run": "run a firmware image and show what its UART says",
    "screenshot": "run a firmware image and write the picture its camera captured",
    "disasm": "print a firmware image as assembly with symbols and source lines",
    "info": "print sections, memory use, vectors and configuration words",
    "footprint": "print what a firmware image costs in ROM and RAM; fit the kernel's memory equation",
    "profile": "print the CPU load by function and interrupt level in percent, from exact cycles",
    "cycles": "measure the kernel's operations in exact cycles; check them against a baseline",
    "coverage": "tell which lines, branches and instructions a run executes (lcov, Cobertura)",
    "inject": "inject faults by a campaign file and tell what becomes of them",
    "debug": "debug at a prompt, or serve an editor (Debug Adapter Protocol)",
    "completion": "print what makes a shell complete these commands and their options",
}
"""Name and description of every command; the module of that name has `parser()` and `run()`."""
