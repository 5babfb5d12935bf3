"""The linker's view of the chip: where sections may go, which names it provides.  All numbers come from `emu.chips`."""

from __future__ import annotations

from bisect import insort
from dataclasses import dataclass, field
from functools import lru_cache

from emu.chips.dspic30f6014a import CONFIG, DSPIC30F6014A, UNIT_ID
from emu.elffacts import UNITS_PER_WORD

CHIP = DSPIC30F6014A
FLASH, PROGRAM = CHIP.program["flash"], CHIP.program["program"]
RESET, IVT, AIVT = CHIP.program["reset"], CHIP.program["ivt"], CHIP.program["aivt"]
EEPROM = CHIP.program["eedata"]
RAM, NEAR, X_RAM, Y_RAM = CHIP.data["ram"], CHIP.data["near"], CHIP.data["xram"], CHIP.data["yram"]
HANDLE_LIMIT = 0x10000  # abi-elf.md §1.5: a function pointer is 16 bits
UNIT_ID_WORDS = 4  # FUID0..3, abi-elf.md §3.3


@lru_cache(1)
def config_sections() -> dict[str, int]:
    """Input section name -> program address of the configuration and unit-id words (abi-elf.md §6.6)."""
    places = {f"__{name}.sec": word.address for name, word in CONFIG.items()}
    for index in range(UNIT_ID_WORDS):
        places[f"__FUID{index}.sec"] = UNIT_ID.start + index * UNITS_PER_WORD
    return places


def script_symbols() -> dict[str, int]:
    """Absolute symbols of a device's linker script (abi-elf.md §3.3): bases, config words, SFRs in two spellings."""
    symbols = {
        "__CODE_BASE": PROGRAM.start,
        "__IVT_BASE": IVT.start,
        "__AIVT_BASE": AIVT.start,
        "__DATA_BASE": RAM.start,
        "__DATA_LENGTH": RAM.size,
        "__YDATA_BASE": Y_RAM.start,
    }
    for name, word in CONFIG.items():
        symbols[f"__{name}"] = word.address
    for name, sfr in CHIP.sfrs.items():
        symbols[name] = symbols[f"_{name}"] = symbols[f"_{name}bits"] = sfr.address
    for accumulator in ("ACCA", "ACCB"):  # three registers each; `PUSH ACCA` takes the lowest (abi-elf.md §3.3)
        symbols[accumulator] = symbols[f"_{accumulator}"] = CHIP.sfrs[f"{accumulator}L"].address
    return symbols


@dataclass(slots=True)
class Pool:
    """Free intervals of one space, in address units, sorted; allocation is first fit, so results repeat."""

    start: int
    end: int
    free: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.free = [(self.start, self.end)]

    def reserve(self, start: int, size: int) -> bool:
        """Take exactly [start, start + size); False when part of it is taken or outside."""
        for index, (low, high) in enumerate(self.free):
            if low <= start and start + size <= high:
                self._cut(index, start, size)
                return True
        return size == 0 and self.start <= start <= self.end

    def allocate(self, size: int, align: int, low: int, high: int, window: int = 0) -> int | None:
        """Take `size` units from the lowest fitting place in [low, high); with `window`, not across its multiples."""
        for index, (begin, end) in enumerate(self.free):
            at = self._fit(max(begin, low), min(end, high), size, align, window)
            if at is not None:
                self._cut(index, at, size)
                return at
        return None

    def allocate_top(self, size: int, align: int, low: int, high: int, reverse: bool = False) -> int | None:
        """As `allocate`, from the highest place down; `reverse` aligns the end instead of the start."""
        for index in range(len(self.free) - 1, -1, -1):
            begin, end = max(self.free[index][0], low), min(self.free[index][1], high)
            at = end // align * align - size if reverse else (end - size) // align * align
            if at >= begin and size <= end - begin:
                self._cut(index, at, size)
                return at
        return None

    @staticmethod
    def _fit(begin: int, end: int, size: int, align: int, window: int) -> int | None:
        at = -(-begin // align) * align
        if window and size and at // window != (at + size - 1) // window:
            at = -(-(-(-at // window) * window) // align) * align
        return at if at + size <= end else None

    def _cut(self, index: int, start: int, size: int) -> None:
        low, high = self.free.pop(index)
        if low < start:
            insort(self.free, (low, start))
        if start + size < high:
            insort(self.free, (start + size, high))

    def room(self, low: int, high: int) -> int:
        """Free units within [low, high)."""
        return sum(max(0, min(e, high) - max(b, low)) for b, e in self.free)

    def largest(self) -> tuple[int, int]:
        """The largest free interval, (0, 0) when nothing is free."""
        return max(self.free, key=lambda piece: piece[1] - piece[0], default=(0, 0))
