"""A C program on several engines: its build, and machines whose native code runs from the first instruction."""

from __future__ import annotations

from pathlib import Path

import emu
from emu.dspic30f.jit.engine import JitEngine
from emu.machine.machine import Machine
from toolchain.driver import driver


def build(folder: Path, source: str) -> Path:
    """Compile a C program with -Os -g and return its image, `p.elf` in the folder."""
    (folder / "p.c").write_text(source)
    assert driver.main(["-Os", "-g", str(folder / "p.c"), "-o", str(folder / "p.elf")]) == 0
    return folder / "p.elf"


def compile_eagerly(machine: Machine) -> None:
    """Let the machine compile each region when it first reaches it, and wait for the code; other engines ignore it."""
    if isinstance(machine.runner, JitEngine):
        machine.runner.threshold = 1
        machine.runner.wait = True


def machine_of(image: Path, engine: str) -> emu.Machine:
    """Return a machine without a board that runs an image on an engine and compiles eagerly."""
    machine = emu.load(image, engine=engine, board=None)
    compile_eagerly(machine)
    return machine
