"""The Python interface in one call: an image loaded into a machine, and variables watched by name.

>>> import emu
>>> machine = emu.load("tests/emu/cli/hello.hex")
>>> said = bytearray()
>>> machine.uart[1].on_byte = lambda byte, cycle: said.append(byte)
>>> stop = machine.run(cycles=14_745_600)       # one second of an e-puck
>>> stop.reason, bytes(said)
('halt', b'hi!\\n')
>>> machine.w[0], hex(machine.pc), machine.peek("U1BRG")
(5, '0x11e', 7)

A snapshot is a copy of everything, also across engines:

>>> again = emu.load("tests/emu/cli/hello.hex", engine="plain")
>>> again.run(until=0x104).reason               # or a function that says when
'until'
>>> state = again.snapshot()
>>> _ = again.run()
>>> again.restore(state)
>>> again.run().cycle == stop.cycle
True
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emu.boards import board_named
from emu.chips import chip_named
from emu.image.loader import load_image
from emu.machine.machine import Machine
from emu.machine.stops import Stop
from emu.peripherals import Peripherals


def load(
    path: str | os.PathLike[str],
    *,
    engine: str = "auto",
    ipl_slip: int = 0,
    board: Callable[[Peripherals], Any] | str | None = "epuck",
    strict: bool = False,
    chip: str | None = None,
) -> Machine:
    """A machine with the firmware file at `path`, ELF or Intel HEX, ready to run from reset.

    `board` is what is around the chip: "epuck" as on the command line, "none" or None for bare pins, or what to call
    with the chip's peripherals, for example `functools.partial(emu.boards.epuck.board.Epuck, selector=3)`.
    `engine` is "auto", "jit", "interp" or "plain"; all give the same run. With `strict` the plain one also finds null
    pointers, uninitialised reads and stores into other threads' stacks, and calls them faults.
    `chip` is the part a HEX file is for (an ELF file says so itself): "dsPIC30F6014A" or "dsPIC30F4013".
    Raises `emu.LoadError` if the file is not a usable image, ValueError for an unknown engine, board or chip.
    """
    image = load_image(path, None if chip is None else chip_named(chip))
    maker = board_named(board) if isinstance(board, str) else board
    machine = Machine(image.chip, engine=engine, ipl_slip=ipl_slip, board=maker, strict=strict)
    machine.load(image)
    return machine


def build(
    *sources: str | os.PathLike[str], flags: Sequence[str] = ("-Os", "-g"), output: str | os.PathLike[str]
) -> Path:
    """Compile and link C files to the ELF file `output`, with the project's own compiler, for an e-puck's chip unless
    `flags` say otherwise. Returns the path. Raises BuildError with what the compiler said."""
    files = [*(os.fspath(source) for source in sources), "-o", os.fspath(output)]
    words = [sys.executable, "-m", "toolchain", "cc", *flags, *files]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BuildError(done.stderr.strip() or f"the compiler ended with status {done.returncode}")
    return Path(output)


class BuildError(RuntimeError):
    """The compiler refused a program; the text is what it said."""


@dataclass(frozen=True, slots=True)
class Change:
    """A watched value has changed: by the instruction that ended before `cycle`; `pc` is the next one."""

    cycle: int
    pc: int
    old: int
    new: int


def watch(machine: Machine, place: str | int, *, size: int = 2, cycles: int | None = None) -> Iterator[Change]:
    """Run `machine` and yield every change of a variable, register or data address (`size` 1 or 2 bytes).

    Looks after every instruction, so it runs at the speed of single steps. Ends with the run, after `cycles` Tcy at
    the latest. Raises KeyError for an unknown name.
    """
    address = machine.address_of(place)
    value = machine.peek(address, size)
    changes: list[Change] = []

    def changed() -> bool:
        nonlocal value
        now = machine.peek(address, size)
        if now != value:
            changes.append(Change(machine.cycle, machine.pc, value, now))
            value = now
        return bool(changes)

    end = None if cycles is None else machine.cycle + cycles
    while True:
        stop: Stop = machine.run(cycles=None if end is None else end - machine.cycle, until=changed)
        yield from changes
        if stop.reason != "until":
            return
        changes.clear()
