"""The AVR core beside simavr (oracle.c): random instructions of a row, and programs in lock step."""

from __future__ import annotations

import ctypes
import functools
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from emu.avr.core.addresses import ADDRESSES
from emu.avr.core.state import FLASH_BYTES, PROGRAM_ENTRIES, Avr, Decoded, declaration
from emu.avr.isa.row import Row
from emu.avr.isa.rows import ROWS
from emu.avr.native import TYPES, native
from emu.native_library import address_of
from firmware.tools.simulated.kilobot import compiled

HERE = Path(__file__).parent
GPIOR0, GPIOR1, GPIOR2, SREG = (ADDRESSES[name] for name in ("GPIOR0", "GPIOR1", "GPIOR2", "SREG"))
MEMORY_REGISTERS = {GPIOR0, GPIOR1, GPIOR2, SREG}
"""Data addresses of I/O registers that are the same plain memory in both emulators."""
NOT_COMPARED = ("sleep", "wdr", "break", "spm")
"""Rows whose effect is outside the CPU; tests of the devices check them."""


@functools.cache
def library() -> ctypes.CDLL:
    """Return the compiled oracle. Raises NotInstalled."""
    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / "oracle.c"
        text.write_text("\n".join([TYPES, declaration(), (HERE / "oracle.c").read_text()]))
        loaded = compiled(text)
    handle = ctypes.c_void_p
    loaded.pair_open.restype, loaded.pair_open.argtypes = handle, [handle] * 4
    loaded.pair_close.argtypes = [handle]
    loaded.pair_difference.restype, loaded.pair_difference.argtypes = ctypes.c_char_p, [handle]
    loaded.pair_load.argtypes = [handle, ctypes.c_char_p, ctypes.c_int64]
    loaded.pair_row.restype = loaded.pair_lockstep.restype = ctypes.c_int64
    loaded.pair_row.argtypes = [handle, ctypes.POINTER(ctypes.c_uint16), ctypes.c_int64, ctypes.c_int64,
                                ctypes.c_uint64]  # fmt: skip
    loaded.pair_lockstep.argtypes = [handle, ctypes.c_int64]
    return loaded


class Pair:
    """simavr and the emulator, at the same state. Raises NotInstalled."""

    def __init__(self) -> None:
        self._library = library()
        self._state = Avr()
        self._state.boot_start = FLASH_BYTES // 2
        self._code = (Decoded * PROGRAM_ENTRIES)()
        functions = native()
        functions["avr_power_on"](ctypes.addressof(self._state))
        self._handle = self._library.pair_open(
            ctypes.addressof(self._state), ctypes.addressof(self._code), address_of(functions["avr_run"]),
            address_of(functions["avr_decode"]),
        )  # fmt: skip
        assert self._handle

    def row(self, row: Row, tries: int, seed: int) -> str:
        """Compare random words and states of a row. Return a description of the first difference, or ""."""
        words = legal_words(row)
        listed = (ctypes.c_uint16 * len(words))(*words)
        done = self._library.pair_row(self._handle, listed, len(words), tries, seed)
        return "" if done == tries else f"{row.syntax}: {self.difference}"

    def load(self, flash: bytes) -> None:
        """Load a program into both."""
        self._library.pair_load(self._handle, flash, len(flash))

    def lockstep(self, steps: int) -> str:
        """Execute instructions in both. Return a description of the first difference, or ""."""
        return "" if self._library.pair_lockstep(self._handle, steps) == steps else self.difference

    @property
    def difference(self) -> str:
        """Return the first difference."""
        return str(self._library.pair_difference(self._handle).decode())

    def close(self) -> None:
        """End simavr."""
        self._library.pair_close(self._handle)


def compared_rows() -> Sequence[Row]:
    """Return the rows whose effect is inside the CPU."""
    return [row for row in ROWS if row.mnemonic not in NOT_COMPARED]


def words_of(row: Row) -> Iterator[int]:
    """Yield all words of a row."""
    free = ~row.mask & 0xFFFF
    bits = free
    while True:  # all subsets of the free bits
        yield row.match | bits
        if not bits:
            return
        bits = (bits - 1) & free


@functools.cache
def legal_words(row: Row) -> tuple[int, ...]:
    """Return the words of a row that both emulators define."""
    return tuple(word for word in words_of(row) if is_defined(row, word))


def is_defined(row: Row, word: int) -> bool:
    """Whether the manual defines the result, the I/O register is plain memory, and a target is within flash.

    The chip ignores the upper bits of a target; simavr leaves flash.
    """
    values = row.operands(word)
    if row.mnemonic in ("jmp", "call") and values["k"]:
        return False
    if "A" in values and values["A"] + 0x20 not in MEMORY_REGISTERS:
        return False
    steps = row.syntax.split(",")
    for pointer, first in (("X", 26), ("Y", 28), ("Z", 30)):
        moved = any(f"-{pointer}" in part or (f"{pointer}+" in part and "q" not in part) for part in steps)
        if moved and values["d"] in (first, first + 1):
            return False
    return True
