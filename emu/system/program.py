"""Program memory: flash, data EEPROM, unit ID and configuration words, and the latches of table writes.

Inputs: words from a loader, table writes of the CPU, programming by the NVM device. Output: 24-bit words. Addresses are
PC units: even, two per 24-bit word (isa.md §1.1). All storage is in the state record.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.chips.chip import Chip
from emu.system.record import Record

ERASED_WORD: Final = 0xFFFFFF
"""Value of an erased flash word, which executes as NOPR (isa.md §4.1)."""
ERASED_HALF: Final = 0xFFFF

FLASH_LATCHES: Final = 32
"""Number of instruction words per flash row (dspic30f6014a.md §16)."""
EEPROM_LATCHES: Final = 16
"""Number of words per EEPROM row (dspic30f6014a.md §16)."""


class ProgramMemory:
    """The whole program space. `flash` is a view of the record; native code reads the same memory."""

    def __init__(self, record: Record, chip: Chip) -> None:
        regions = chip.program
        self._flash_end: Final = regions["flash"].end
        self._vectors: Final = (regions["ivt"].start, regions["aivt"].end)
        self._eeprom: Final = regions["eedata"]
        self._unit: Final = regions["unitid"]
        self._config: Final = regions["config"]
        self._words: Final = chip.config
        self._device: Final = regions["devid"]
        self._device_words: Final = (chip.device_id, chip.revision)

        def words(name: str, kind: str, count: int) -> tuple[memoryview, int]:
            field = record.reserve(name, kind, count)
            view = {"I": record.u32, "H": record.u16}[kind]
            return view[field.index : field.index + count], field.offset

        self.flash, self.flash_offset = words("program.flash", "I", self._flash_end // 2)
        self.eeprom, _ = words("program.eeprom", "H", self._eeprom.size // 2)
        self.unit, _ = words("program.unit", "I", self._unit.size // 2)
        self.config, _ = words("program.config", "H", self._config.size // 2)
        self.flash_latch, _ = words("program.flash_latch", "I", FLASH_LATCHES)
        self.eeprom_latch, _ = words("program.eeprom_latch", "H", EEPROM_LATCHES)
        self.changed: Final[list[Callable[[int, int], None]]] = []
        """Listeners fn(start, end), called after flash words in [start, end) changed: translations are now invalid."""
        self._u16: Final = record.u16
        self.captured_in: tuple[int, int] | None = None
        """Data addresses of the registers that store the address of each table write, low word and upper byte
        (dspic30f6014a.md §16)."""
        self.erase()

    @property
    def eeprom_range(self) -> tuple[int, int]:
        """Return the start and end address of data EEPROM."""
        return self._eeprom.start, self._eeprom.end

    def erase(self) -> None:
        """Set all program memory and latches to ones, as in a new chip."""
        for words, erased in (
            (self.flash, ERASED_WORD), (self.eeprom, ERASED_HALF), (self.config, ERASED_HALF), (self.unit, ERASED_WORD)
        ):  # fmt: skip
            words.cast("B")[:] = erased.to_bytes(words.itemsize, "little") * len(words)
        self.clear_latches()
        self._announce(0, self._flash_end)

    def clear_latches(self) -> None:
        """Set all latches to ones, as after a programming operation (dspic30f6014a.md §16)."""
        for word in range(FLASH_LATCHES):
            self.flash_latch[word] = ERASED_WORD
        for word in range(EEPROM_LATCHES):
            self.eeprom_latch[word] = ERASED_HALF

    def word(self, address: int) -> int:
        """Return the 24-bit word at the even `address`; 0 for unimplemented memory (isa.md §1.1)."""
        if address < self._flash_end:
            return self.flash[address >> 1]
        if address in self._eeprom:
            return self.eeprom[address - self._eeprom.start >> 1]
        if address in self._config:
            return self.config[address - self._config.start >> 1]
        if address in self._unit:
            return self.unit[address - self._unit.start >> 1]
        if address in self._device:
            return self._device_words[address - self._device.start >> 1]
        return 0

    def setting(self, name: str) -> int:
        """Return the stored configuration word called `name`. Raises KeyError if the chip has no such word."""
        return self.word(self._words[name].address)

    def executable(self, address: int) -> bool:
        """Return whether an instruction can be fetched at `address` (isa.md §14.4, causes 4 and 5)."""
        start, end = self._vectors
        return address < start or end <= address < self._flash_end

    def put(self, address: int, value: int) -> None:
        """Set the word at the even `address`, for loading and programming.

        Raises ValueError for unimplemented memory.
        """
        if address < self._flash_end:
            self.flash[address >> 1] = value & ERASED_WORD
            self._announce(address, address + 2)
        elif address in self._eeprom:
            self.eeprom[address - self._eeprom.start >> 1] = value & ERASED_HALF
        elif address in self._config:
            self.config[address - self._config.start >> 1] = value & ERASED_HALF
        elif address in self._unit:
            self.unit[address - self._unit.start >> 1] = value & ERASED_WORD
        else:
            raise ValueError(f"no program memory at {address:#08x}")

    def put_flash(self, address: int, words: list[int]) -> None:
        """Set consecutive flash words from the even `address` on, and call the listeners once."""
        first = address >> 1
        for index, value in enumerate(words):
            self.flash[first + index] = value & ERASED_WORD
        self._announce(address, address + 2 * len(words))

    def table_write(self, address: int, byte_mask: int, value: int) -> None:
        """Merge bytes of `value` into the latch of `address`. Bit i of `byte_mask` selects byte i (isa.md §7.7).

        Flash latches are numbered by address bits 5:1, EEPROM latches by bits 4:1 (dspic30f6014a.md §16).
        """
        bits = sum(0xFF << 8 * byte for byte in range(3) if byte_mask >> byte & 1)
        if address in self._eeprom:
            index = address >> 1 & EEPROM_LATCHES - 1
            bits &= ERASED_HALF
            self.eeprom_latch[index] = self.eeprom_latch[index] & ~bits & ERASED_HALF | value & bits
        else:
            index = address >> 1 & FLASH_LATCHES - 1
            self.flash_latch[index] = self.flash_latch[index] & ~bits & ERASED_WORD | value & bits
        if self.captured_in is not None:
            low, upper = self.captured_in
            self._u16[low >> 1], self._u16[upper >> 1] = address & 0xFFFF, address >> 16 & 0xFF

    def announce_all(self) -> None:
        """Call the listeners for all of flash after a snapshot was restored."""
        self._announce(0, self._flash_end)

    def _announce(self, start: int, end: int) -> None:
        for listener in self.changed:
            listener(start, end)
