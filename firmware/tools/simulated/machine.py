"""Interface of simulated robots for measurements and tests, and the symbols of their images."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Protocol

from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection


class NotInstalled(Exception):
    """A required program or library is missing; the text names its Debian package."""


class Stopped(Exception):
    """The run ended before its target: the firmware stopped, crashed, or exceeded the time limit."""


class Symbols:
    """Addresses and sizes by name. `thumb` clears bit 0 of functions."""

    def __init__(self, path: Path) -> None:
        with path.open("rb") as file:
            elf = ELFFile(file)
            self.thumb = elf["e_machine"] == "EM_ARM"
            tables = [section for section in elf.iter_sections() if isinstance(section, SymbolTableSection)]
            found = {symbol.name: symbol.entry for table in tables for symbol in table.iter_symbols() if symbol.name}
            self.sections: dict[str, int] = {
                section.name: section["sh_size"] for section in elf.iter_sections() if section["sh_flags"] & 2
            }
        self._address: dict[str, int] = {name: entry["st_value"] for name, entry in found.items()}
        self._function = {name for name, entry in found.items() if entry["st_info"]["type"] == "STT_FUNC"}
        self.size: dict[str, int] = {name: entry["st_size"] for name, entry in found.items()}

    def __contains__(self, name: str) -> bool:
        return name in self._address

    def __getitem__(self, name: str) -> int:
        """Return the address of a symbol. Raises KeyError."""
        address = self._address[name]
        return address & ~1 if self.thumb and name in self._function else address

    def span(self, name: str) -> range:
        """Return the addresses of a function."""
        return range(self[name], self[name] + self.size[name])


class Machine(Protocol):
    """A paused simulated robot."""

    symbols: Symbols
    pointer: int
    """Bytes of a pointer."""

    @property
    def pc(self) -> int:
        """Byte address of the next instruction."""

    @property
    def now(self) -> int:
        """Cycles or instructions so far."""

    def step(self) -> None:
        """Execute one instruction, including an interrupt entry."""

    def run_to(self, *places: str | int) -> int:
        """Execute at least one instruction, then run to one of the places (symbols or addresses); return it.

        Raises Stopped."""

    def peek_bytes(self, address: int, count: int) -> bytes:
        """Data memory."""

    def poke_bytes(self, address: int, data: bytes) -> None:
        """Data memory."""

    def return_address(self) -> int:
        """Return the return address, at the first instruction of a function."""

    def close(self) -> None:
        """End the simulator."""


def peek(machine: Machine, name: str, offset: int = 0, size: int = 2) -> int:
    """Read an unsigned little-endian number at a symbol."""
    return int.from_bytes(machine.peek_bytes(machine.symbols[name] + offset, size), "little")


def pointer(machine: Machine, name: str) -> int:
    """Read a pointer variable."""
    return peek(machine, name, size=machine.pointer)


def poke_words(machine: Machine, name: str, values: tuple[int, ...]) -> None:
    """Read consecutive 16-bit words from a symbol on."""
    machine.poke_bytes(machine.symbols[name], struct.pack(f"<{len(values)}H", *values))


def peek_words(machine: Machine, name: str, count: int) -> tuple[int, ...]:
    """Return bytes as consecutive 16-bit words."""
    return struct.unpack(f"<{count}H", machine.peek_bytes(machine.symbols[name], 2 * count))
