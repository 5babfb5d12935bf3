"""Names of a firmware image: from a name to an address, and from an address to the name people know it by.

What enters: the symbols an ELF reader found. What leaves: `Symbol`s. Values follow abi-elf.md §6.5: PC units for code,
bytes for data, the PSV window address (0x8000 and up) for constants.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

_COMPILER_LABEL: Final = re.compile(r"\.L|L\d|___(PA|BP)___|__ext_attr_|\.(LFE|LSM|LBB)")
"""Labels of the compiler and assembler that name nothing a person wrote (abi-elf.md §4.3, §6.5)."""


@dataclass(frozen=True, slots=True)
class Symbol:
    """One defined symbol. `size` is in units of `address`; 0 for assembly and for everything from C30."""

    name: str
    address: int
    size: int
    kind: str
    """"function", "object" or "label"."""
    space: str
    """"code", "data", "psv", "eedata", "info" or "absolute"."""
    is_global: bool
    load_address: int | None
    """Program address of code and constants, None for RAM and absolute symbols."""

    @property
    def is_compiler_label(self) -> bool:
        """Whether the name was made by a compiler or assembler."""
        return _COMPILER_LABEL.match(self.name) is not None

    @property
    def names_content(self) -> bool:
        """Whether what follows the symbol is called by its name: functions, objects, global labels."""
        return not self.is_compiler_label and (self.kind != "label" or self.is_global)


class Symbols:
    """All symbols of an image."""

    def __init__(self, symbols: Iterable[Symbol]) -> None:
        self.all: Final = tuple(symbols)
        self._by_name: Final[dict[str, Symbol]] = {}
        for symbol in sorted(self.all, key=lambda s: s.is_global):
            self._by_name[symbol.name] = symbol
        self._code: Final = _Ladder(symbol for symbol in self.all if symbol.space == "code")
        self._data: Final = _Ladder(symbol for symbol in self.all if symbol.space == "data")

    def __len__(self) -> int:
        return len(self.all)

    def find(self, name: str) -> Symbol | None:
        """The symbol called `name`, as in the object (`_main`) or as in C (`main`); None if there is none."""
        return self._by_name.get("_" + name) or self._by_name.get(name)

    def code(self, pc: int) -> tuple[Symbol, int] | None:
        """The function or label `pc` belongs to, and the distance from it in PC units; None behind a function's end."""
        return self._code.below(pc)

    def data(self, address: int) -> tuple[Symbol, int] | None:
        """The variable a data address belongs to, and the distance from its start in bytes."""
        found = self._data.below(address)
        return found if found and (found[1] == 0 or found[1] < found[0].size) else None

    def labels(self, address: int) -> list[Symbol]:
        """Code symbols exactly at `address` that a person wrote, functions first."""
        return self._code.at(address)

    def text(self, pc: int) -> str:
        """`_main+0x12` for a program address, the bare number in hex if no symbol lies below it."""
        found = self.code(pc)
        if found is None:
            return f"{pc:#08x}"
        symbol, distance = found
        return f"{symbol.name}+{distance:#x}" if distance else symbol.name


def _rank(symbol: Symbol) -> int:
    """How well a symbol names the code or data behind it: functions and objects, then global, then local labels."""
    if symbol.kind != "label":
        return 2
    return 1 if symbol.is_global else 0


class _Ladder:
    """Symbols of one space in address order. Local labels name only what no better symbol precedes."""

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
