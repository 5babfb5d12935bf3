"""Symbols of a firmware image, by name and by address.

Input: the symbols found by the ELF reader. Output: `Symbol`s. Values follow abi-elf.md §6.5: PC units for code,
bytes for data, the PSV window address (0x8000 and up) for constants.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

STOP_FUNCTION: Final = "hal_stop"
"""Function in which OpenSwarm halts after a failed assertion or a fatal trap (firmware/openswarm/hal/hal_cpu.h)."""
_COMPILER_LABEL: Final = re.compile(r"\.L|L\d|___(PA|BP)___|__ext_attr_|\.(LFE|LSM|LBB)")
"""Pattern of labels that the compiler and assembler generate (abi-elf.md §4.3, §6.5)."""


@dataclass(frozen=True, slots=True)
class Symbol:
    """One defined symbol. `size` is in units of `address`; it is 0 for assembly code and for all symbols from C30."""

    name: str
    address: int
    size: int
    kind: str
    """Kind of symbol: "function", "object" or "label"."""
    space: str
    """Address space: "code", "data", "psv", "eedata", "info" or "absolute"."""
    is_global: bool
    load_address: int | None
    """Program address of code and constants; None for RAM and absolute symbols."""

    @property
    def is_compiler_label(self) -> bool:
        """Whether a compiler or assembler generated the name."""
        return _COMPILER_LABEL.match(self.name) is not None

    @property
    def names_content(self) -> bool:
        """Whether the symbol names the code or data after it: functions, objects, global labels."""
        return not self.is_compiler_label and (self.kind != "label" or self.is_global)


class Symbols:
    """All symbols of an image, searchable by name and by address."""

    def __init__(self, symbols: Iterable[Symbol]) -> None:
        self.all: Final = tuple(symbols)
        self._by_name: Final[dict[str, Symbol]] = {}
        for symbol in sorted(self.all, key=lambda s: s.is_global):
            self._by_name[symbol.name] = symbol
        self._code: Final = _AddressIndex(symbol for symbol in self.all if symbol.space == "code")
        self._data: Final = _AddressIndex(symbol for symbol in self.all if symbol.space == "data")

    def __len__(self) -> int:
        return len(self.all)

    def find(self, name: str) -> Symbol | None:
        """Return the symbol called `name`, written as in the object (`_main`) or as in C (`main`); None if unknown."""
        return self._by_name.get("_" + name) or self._by_name.get(name)

    def code(self, pc: int) -> tuple[Symbol, int] | None:
        """Return the function or label that contains `pc`, and the distance in PC units;

        None after the symbol's end.
        """
        return self._code.below(pc)

    def variable_at(self, address: int) -> tuple[Symbol, int] | None:
        """Return the variable that contains a data address, and the distance from its start in bytes."""
        found = self._data.below(address)
        return found if found and (found[1] == 0 or found[1] < found[0].size) else None

    def labels(self, address: int) -> list[Symbol]:
        """Return the code symbols at `address` that are not compiler labels, functions first."""
        return self._code.at(address)

    def text(self, pc: int) -> str:
        """Return a program address as text `_main+0x12`, or as a hex number if no symbol precedes it."""
        found = self.code(pc)
        if found is None:
            return f"{pc:#08x}"
        symbol, distance = found
        return f"{symbol.name}+{distance:#x}" if distance else symbol.name


def _rank(symbol: Symbol) -> int:
    """Return the rank of a symbol for naming: functions and objects first, then global labels, then local ones."""
    if symbol.kind != "label":
        return 2
    return 1 if symbol.is_global else 0


class _AddressIndex:
    """Symbols of one address space in address order. A local label is used only if no better symbol precedes it."""

    def __init__(self, symbols: Iterable[Symbol]) -> None:
        mine = [symbol for symbol in symbols if not symbol.is_compiler_label]
        mine.sort(key=lambda symbol: (symbol.address, _rank(symbol), symbol.is_global))
        self._all: Final = mine
        self._addresses: Final = [symbol.address for symbol in mine]
        self._good: Final = [symbol for symbol in mine if _rank(symbol) > 0]
        self._good_addresses: Final = [symbol.address for symbol in self._good]

    def below(self, address: int) -> tuple[Symbol, int] | None:
        for symbols, addresses in ((self._good, self._good_addresses), (self._all, self._addresses)):
            index = bisect_right(addresses, address) - 1
            if index >= 0:
                distance = address - addresses[index]
                if not symbols[index].size or distance < symbols[index].size:
                    return symbols[index], distance
        return None

    def at(self, address: int) -> list[Symbol]:
        end = bisect_right(self._addresses, address)
        start = end
        while start and self._addresses[start - 1] == address:
            start -= 1
        return self._all[start:end][::-1]
