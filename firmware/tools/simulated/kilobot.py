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
SOURCES = (HERE / "simavr.c", HERE / "air.c")
HZ = 8_000_000
PATIENCE = 80_000_000
"""Cycle limit of a run: 10 s."""
DATA = 0x800000
"""Address of data memory in ELF files."""
_DONE, _CRASHED, _AT_PLACE = 1, 2, 3


def compiled(*sources: Path) -> ctypes.CDLL:
    """Return the library of C files that call simavr. Raises NotInstalled."""
    for program, package in (("gcc", "gcc"), ("pkg-config", "pkg-config")):
        if shutil.which(program) is None:
            raise NotInstalled(f"{program} is not installed; Debian package: {package}")
    # Not --cflags, which fails without libelf's development package; only a static link of simavr needs libelf.
    asked = ["pkg-config", "--variable=includedir", "simavr"]
    found = subprocess.run(asked, capture_output=True, text=True, check=False)
    if found.returncode != 0:
        raise NotInstalled("simavr's library is not installed; Debian package: libsimavr-dev")
    flags = [f"-I{found.stdout.strip()}/simavr", "-lsimavr"]
    with tempfile.TemporaryDirectory(prefix="openswarm-simavr-") as folder:  # the loaded library stays usable
        object_ = Path(folder) / "simavr.so"
        command = ["gcc", "-O2", "-shared", "-fPIC", *map(str, sources), *flags, "-o", str(object_)]
        subprocess.run(command, check=True)
        return ctypes.CDLL(str(object_))


@functools.cache
def library() -> ctypes.CDLL:
    """Return the library of simavr.c and air.c, compiled once per process. Raises NotInstalled."""
    made = compiled(*SOURCES)
    handle = ctypes.c_void_p
    for name, result, arguments in (
        ("machine_open", handle, [ctypes.c_char_p, ctypes.c_uint32]),
        ("machine_close", None, [handle]),
        ("machine_step", ctypes.c_int, [handle]),
        ("machine_steps", ctypes.c_int, [handle, ctypes.c_uint32]),
        ("machine_instructions", ctypes.c_uint64, [handle]),
        ("machine_run", ctypes.c_int, [handle, ctypes.POINTER(ctypes.c_uint32), ctypes.c_int, ctypes.c_uint64]),
        ("machine_pc", ctypes.c_uint32, [handle]),
        ("machine_cycle", ctypes.c_uint64, [handle]),
        ("machine_data", ctypes.POINTER(ctypes.c_uint8), [handle]),
        ("machine_interrupt", ctypes.c_int, [handle, ctypes.c_uint8]),
        ("machine_receive", None, [handle, ctypes.c_uint8]),
        ("machine_eeprom", ctypes.c_int, [handle, ctypes.c_char_p, ctypes.c_uint32, ctypes.c_uint32]),
        ("machine_uart", ctypes.c_uint32, [handle, ctypes.c_char_p, ctypes.c_uint32]),
        ("machine_watch", None, [handle, ctypes.c_uint16, ctypes.c_uint16]),
        ("machine_lowest", ctypes.c_uint16, [handle]),
        ("air_open", handle, [ctypes.c_uint32]),
        ("air_close", None, [handle]),
        ("air_join", ctypes.c_int, [handle, handle, ctypes.c_uint64]),
        ("air_link", None, [handle, *[ctypes.c_int] * 2, *[ctypes.c_uint16] * 3]),
        ("air_flash", None, [handle, ctypes.c_int, ctypes.c_uint32, *[ctypes.c_uint16] * 2]),
        ("air_run", ctypes.c_int, [handle, ctypes.c_uint64]),
    ):
        function = getattr(made, name)
        function.restype, function.argtypes = result, arguments
    return made


class Kilobot:
    """A Kilobot's CPU at its reset vector. Raises NotInstalled."""

    pointer = 2
    handle: int | None
    """Handle of simavr.c; None: closed."""

    def __init__(self, image: Path) -> None:
        self._library = library()
        self.symbols = Symbols(image)
        self.handle = self._library.machine_open(str(image).encode(), HZ)
        if not self.handle:
            raise Stopped(f"simavr does not load {image}")
        self._data = self._library.machine_data(self.handle)

    @property
    def pc(self) -> int:
        return int(self._library.machine_pc(self.handle))

    @property
    def now(self) -> int:
        return int(self._library.machine_cycle(self.handle))

    def _check(self, how: int) -> None:
        if how in (_DONE, _CRASHED):
            what = "stopped" if how == _DONE else "crashed"
            raise Stopped(f"the firmware {what} at {self.pc:#x}, cycle {self.now}")

    def step(self) -> None:
        self._check(self._library.machine_step(self.handle))

    def steps(self, count: int) -> None:
        """Execute a number of instructions."""
        self._check(self._library.machine_steps(self.handle, count))

    @property
    def instructions(self) -> int:
        """Return executed instructions; each period of sleep counts as one."""
        return int(self._library.machine_instructions(self.handle))

    def run(self, cycles: int) -> None:
        """Run for at least a number of cycles."""
        self._check(self._library.machine_run(self.handle, None, 0, self.now + cycles))

    def run_to(self, *places: str | int, patience: int = PATIENCE) -> int:
        addresses = [self.symbols[place] if isinstance(place, str) else place for place in places]
        listed = (ctypes.c_uint32 * len(addresses))(*addresses)
        how = self._library.machine_run(self.handle, listed, len(addresses), self.now + patience)
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
        """Return the stack pointer, which points to the next free byte."""
        low, high = self.peek_bytes(0x5D, 2)
        return low | high << 8

    def return_address(self) -> int:
        stacked = self.peek_bytes(self.sp + 1, 2)
        return 2 * (stacked[0] << 8 | stacked[1])

    def interrupt(self, vector: int) -> None:
        """Set an enabled interrupt's flag."""
        self._library.machine_interrupt(self.handle, vector)

    def receive(self, byte: int) -> None:
        """Send a byte to the UART's receiver."""
        self._library.machine_receive(self.handle, byte)

    def write_eeprom(self, offset: int, data: bytes) -> None:
        """Write the data EEPROM, 1,024 bytes, initially erased. Raises ValueError."""
        if self._library.machine_eeprom(self.handle, data, offset, len(data)) != 0:
            raise ValueError(f"{len(data)} bytes at {offset:#x} are not in the EEPROM")

    def uart(self) -> bytes:
        """Return the UART's output since the last call."""
        room = ctypes.create_string_buffer(1 << 16)
        count = self._library.machine_uart(self.handle, room, len(room))
        return room.raw[:count]

    def watch_stack(self, lowest: int, highest: int) -> None:
        """Start to record the lowest stack pointer between the two addresses."""
        self._library.machine_watch(self.handle, lowest, highest)

    def lowest_sp(self) -> int:
        """Return the lowest recorded stack pointer."""
        return int(self._library.machine_lowest(self.handle))

    def close(self) -> None:
        if self.handle:
            self._library.machine_close(self.handle)
            self.handle = None
