"""An ATmega328P at 8 MHz in simavr, driven through its library (simavr.c)."""

from __future__ import annotations

import ctypes
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

from firmware.tools.simulated.machine import NotInstalled, Stopped, Symbols

HERE = Path(__file__).parent
HZ = 8_000_000
PATIENCE = 80_000_000
"""Cycles: 10 s."""
DATA = 0x800000
"""Where ELF files put data memory."""
_DONE, _CRASHED, _AT_PLACE = 1, 2, 3


@functools.cache
def _library() -> ctypes.CDLL:
    """simavr.c, compiled once per run of Python. Raises NotInstalled."""
    for program, package in (("gcc", "gcc"), ("pkg-config", "pkg-config")):
        if shutil.which(program) is None:
            raise NotInstalled(f"{program} is not installed; Debian package: {package}")
    # Not --cflags: that fails where libelf, which only a static link of simavr needs, has no development package.
    asked = ["pkg-config", "--variable=includedir", "simavr"]
    found = subprocess.run(asked, capture_output=True, text=True, check=False)
    if found.returncode != 0:
        raise NotInstalled("simavr's library is not installed; Debian package: libsimavr-dev")
    flags = [f"-I{found.stdout.strip()}/simavr", "-lsimavr"]
    folder = Path(tempfile.mkdtemp(prefix="openswarm-simavr-"))
    made = folder / "simavr.so"
    command = ["gcc", "-O2", "-shared", "-fPIC", str(HERE / "simavr.c"), *flags, "-o", str(made)]
    try:
        subprocess.run(command, check=True)
        library = ctypes.CDLL(str(made))
    finally:
        shutil.rmtree(folder, ignore_errors=True)  # what is loaded stays
    handle = ctypes.c_void_p
    for name, result, arguments in (
        ("open", handle, [ctypes.c_char_p, ctypes.c_uint32]),
        ("close", None, [handle]),
        ("step", ctypes.c_int, [handle]),
        ("steps", ctypes.c_int, [handle, ctypes.c_uint32]),
        ("instructions", ctypes.c_uint64, [handle]),
        ("run", ctypes.c_int, [handle, ctypes.POINTER(ctypes.c_uint32), ctypes.c_int, ctypes.c_uint64]),
        ("pc", ctypes.c_uint32, [handle]),
        ("cycle", ctypes.c_uint64, [handle]),
        ("data", ctypes.POINTER(ctypes.c_uint8), [handle]),
        ("interrupt", ctypes.c_int, [handle, ctypes.c_uint8]),
        ("receive", None, [handle, ctypes.c_uint8]),
        ("uart", ctypes.c_uint32, [handle, ctypes.c_char_p, ctypes.c_uint32]),
        ("watch", None, [handle, ctypes.c_uint16, ctypes.c_uint16]),
        ("lowest", ctypes.c_uint16, [handle]),
    ):
        function = getattr(library, f"machine_{name}")
        function.restype, function.argtypes = result, arguments
    return library


class Kilobot:
    """A Kilobot's CPU that stands at its reset vector. Raises NotInstalled."""

    pointer = 2

    def __init__(self, image: Path) -> None:
        self._library = _library()
        self.symbols = Symbols(image)
        self._machine = self._library.machine_open(str(image).encode(), HZ)
        if not self._machine:
            raise Stopped(f"simavr does not load {image}")
        self._data = self._library.machine_data(self._machine)

    @property
    def pc(self) -> int:
        return int(self._library.machine_pc(self._machine))

    @property
    def now(self) -> int:
        return int(self._library.machine_cycle(self._machine))

    def _check(self, how: int) -> None:
        if how in (_DONE, _CRASHED):
            what = "stopped" if how == _DONE else "crashed"
            raise Stopped(f"the firmware {what} at {self.pc:#x}, cycle {self.now}")

    def step(self) -> None:
        self._check(self._library.machine_step(self._machine))

    def steps(self, count: int) -> None:
        """That many instructions."""
        self._check(self._library.machine_steps(self._machine, count))

    @property
    def instructions(self) -> int:
        """Instructions so far, each stretch of sleep counted as one."""
        return int(self._library.machine_instructions(self._machine))

    def run(self, cycles: int) -> None:
        """At least that many cycles."""
        self._check(self._library.machine_run(self._machine, None, 0, self.now + cycles))

    def run_to(self, *places: str | int, patience: int = PATIENCE) -> int:
        addresses = [self.symbols[place] if isinstance(place, str) else place for place in places]
        listed = (ctypes.c_uint32 * len(addresses))(*addresses)
        how = self._library.machine_run(self._machine, listed, len(addresses), self.now + patience)
        self._check(how)
        if how != _AT_PLACE:
            raise Stopped(f"not at {', '.join(map(str, places))} after {patience} cycles")
        return self.pc

    def peek_bytes(self, address: int, count: int) -> bytes:
        return bytes(self._data[(address & 0xFFFF) : (address & 0xFFFF) + count])

    def poke_bytes(self, address: int, data: bytes) -> None:
        for at, byte in enumerate(data, address & 0xFFFF):
            self._data[at] = byte

    @property
    def sp(self) -> int:
        """The stack pointer: the next free byte."""
        return self._data[0x5D] | self._data[0x5E] << 8

    def return_address(self) -> int:
        stacked = self.peek_bytes(self.sp + 1, 2)
        return 2 * (stacked[0] << 8 | stacked[1])

    def interrupt(self, vector: int) -> None:
        """Set an enabled interrupt's flag."""
        self._library.machine_interrupt(self._machine, vector)

    def receive(self, byte: int) -> None:
        """A byte arrives at the UART."""
        self._library.machine_receive(self._machine, byte)

    def uart(self) -> bytes:
        """What the UART sent since the last call."""
        room = ctypes.create_string_buffer(1 << 16)
        count = self._library.machine_uart(self._machine, room, len(room))
        return room.raw[:count]

    def watch_stack(self, lowest: int, highest: int) -> None:
        """From now on note the lowest stack pointer between the two addresses."""
        self._library.machine_watch(self._machine, lowest, highest)

    def lowest_sp(self) -> int:
        """The lowest stack pointer noted."""
        return int(self._library.machine_lowest(self._machine))

    def close(self) -> None:
        if self._machine:
            self._library.machine_close(self._machine)
            self._machine = None
