"""Compiles C programs with the driver and runs them on the emulator, in this process.

The result of a program is its exit status, which is available when it sleeps after `main` or `exit`. Any other end
is a failure with a reason.
"""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass, replace
from pathlib import Path

import emu
from toolchain.driver import driver
from toolchain.frontend.options import CcOptions, Input

INTCON1_TRAPS = {1: "oscillator", 2: "stack error", 3: "address error", 4: "math error"}
"""Trap flags of INTCON1 by bit (isa.md §14.4)."""


@dataclass(frozen=True)
class Built:
    """Exit status and stderr output of the driver."""

    status: int
    messages: str

    @property
    def first_error(self) -> str:
        """Return the first message line that contains an error, otherwise the first line."""
        lines = [line for line in self.messages.splitlines() if "error" in line]
        return lines[0] if lines else self.messages.strip().splitlines()[0] if self.messages.strip() else "no message"


@dataclass(frozen=True)
class Ran:
    """Result of a run.

    `status` is W0 after a normal end, otherwise None. `why` is the reason of any other end.
    """

    status: int | None
    why: str
    uart: bytes
    cycles: int


class FrontEndOnce:
    """Front end that caches the IR of a program, for tests that build it in several modes.

    The IR depends on the sources, the level and the C options, but not on -fno-lto or the name of the output. The
    sources must not change between the builds. Diagnostics are printed once.
    """

    def __init__(self) -> None:
        self._made: dict[str, dict[Input, bytes]] = {}

    def __call__(self, options: CcOptions, scratch: Path) -> dict[Input, bytes]:
        """Replace `driver.front_end`: return cached IR, or compile."""
        assert not options.dependency, "a dependency file names the output"
        key = repr(replace(options, lto=None, output=None))
        if key not in self._made:
            self._made[key] = driver.front_end(options, scratch)
        return self._made[key]


def build(sources: list[Path], output: Path, *options: str, front: driver.FrontEnd | None = None) -> Built:
    """Run `python -m toolchain cc options sources -o output` in this process; `front` replaces the front end."""
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        status = driver.main([*options, *map(str, sources), "-o", str(output)], front=front)
    return Built(status, said.getvalue())


def run(image: Path, cycles: int = 30_000_000, engine: str = "auto", native_after: int | None = None) -> Ran:
    """Run an image for at most `cycles` Tcy, in the interpreter first and with the JIT after `native_after` Tcy."""
    machine = emu.load(image, engine=engine)
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, cycle: said.append(byte)
    stop = machine.run(cycles=cycles if native_after is None else min(cycles, native_after))
    if native_after is not None and stop.reason == "limit" and native_after < cycles:
        state = machine.snapshot()
        machine = emu.load(image)
        machine.uart[1].on_byte = lambda byte, cycle: said.append(byte)
        machine.restore(state)
        stop = machine.run(cycles=cycles - native_after)
    if stop.reason == "halt":
        return Ran(machine.w[0], "", bytes(said), stop.cycle)
    why = stop.fault.cause if stop.fault is not None else f"{stop.reason} at {stop.pc:#x} {stop.detail}".strip()
    where = machine.image.symbols.code(stop.pc) if machine.image is not None else None
    if stop.reason == "fault" and where is not None and where[0].name == "__DefaultInterrupt":
        flags = machine.peek("INTCON1")
        traps = [name for bit, name in INTCON1_TRAPS.items() if flags >> bit & 1]
        why = f"trap: {', '.join(traps) or 'unexpected interrupt'}"
    return Ran(None, why, bytes(said), stop.cycle)


def run_both(folder: Path, level: str, c_text: str, s_text: str) -> int:
    """Return the exit status of a program that consists of a C and an assembly file."""
    (folder / "a.c").write_text(c_text)
    (folder / "b.s").write_text("        .section .text,code\n" + s_text)
    built = build([folder / "a.c", folder / "b.s"], folder / "a.elf", level, "-std=gnu11", "-Wall")
    assert built.status == 0, built.messages
    ran = run(folder / "a.elf", engine="auto")
    assert ran.status is not None, ran
    return ran.status
