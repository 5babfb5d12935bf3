"""Access to a machine's memory and registers by name or address, and hooks on register accesses.

Inputs: names of the loaded image and the chip, addresses, values. Outputs: numbers and bytes. Nothing in this module
runs an instruction.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final, Protocol

from emu.chips.chip import Chip
from emu.dspic30f.core import Core
from emu.dspic30f.engines import Engine
from emu.dspic30f.isa.flow import PC_MASK
from emu.dspic30f.state.data_space import WINDOW
from emu.image.model import Image
from emu.system.bus import Tap, tap

NameOrAddress = str | int
"""Name in the loaded image or of the chip, or an address."""
SfrHook = Callable[[bool, int], object]


class MemoryObserver(Protocol):
    """Observer of memory changes that no instruction makes."""

    def on_power_on(self) -> None:
        """Handle a power-on reset, after which RAM is uninitialised."""

    def on_external_write(self, address: int, size: int) -> None:
        """Handle a write of `size` bytes at data address `address` by `poke`."""


class StateAccess:
    """Access to the memory and registers of one chip by name and by address."""

    chip: Chip
    core: Core
    runner: Engine
    image: Image | None
    """The loaded image."""

    def __init__(self, chip: Chip, core: Core) -> None:
        self.chip = chip
        self.core = core
        self.bus: Final = core.bus
        self.record: Final = core.record
        self.program: Final = core.program
        self.image = None
        self.memory_observer: MemoryObserver | None = None
        self._sfr_hooks: Final[dict[int, Tap]] = {}

    def program_address(self, place: NameOrAddress) -> int:
        """Return the program address of a function or label by name. An address is checked and returned.

        Raises KeyError for an unknown name, ValueError for an address at which no instruction can start.
        """
        if isinstance(place, str):
            symbol = self.image.symbols.find(place) if self.image is not None else None
            if symbol is None or symbol.space not in ("code", "absolute"):
                raise KeyError(f"there is no function or label {place!r}")
            return symbol.address
        if place & 1 or not 0 <= place <= PC_MASK:
            raise ValueError(f"{place:#x} is no program address: expected an even number, 0 to {PC_MASK:#x}")
        return place

    def address_of(self, place: NameOrAddress) -> int:
        """Return the data address of a register (`U1STA`, `W3`) or variable by name. An address is returned unchanged.

        Raises KeyError for an unknown name.
        """
        if not isinstance(place, str):
            return place
        sfr = self.chip.sfrs.get(place) or self.chip.sfrs.get(re.sub(r"^[Ww](?=\d+$)", "WREG", place))
        if sfr is not None:
            return sfr.address
        symbol = self.image.symbols.find(place) if self.image is not None else None
        if symbol is None or symbol.space not in ("data", "psv", "absolute"):
            raise KeyError(f"there is no register or variable {place!r}")
        return symbol.address

    def read(self, place: NameOrAddress, size: int = 2) -> int:
        """Read a byte or an aligned word of data space as an instruction does, including side effects.

        Raises ValueError for another size or a word at an odd address, KeyError for an unknown name.
        """
        return self.core.data.read(self._accessed(place, size), size)

    def write(self, place: NameOrAddress, value: int, size: int = 2) -> None:
        """Write a byte or an aligned word of data space as an instruction does, including side effects.

        Raises as `read`.
        """
        self.core.data.write(self._accessed(place, size), value, size)

    def _accessed(self, place: NameOrAddress, size: int) -> int:
        address = self.address_of(place)
        if size not in (1, 2) or address & (size - 1):
            raise ValueError(f"an instruction accesses a byte or an aligned word, not {size} bytes at {address:#06x}")
        return address

    def peek(self, place: NameOrAddress, size: int = 2) -> int:
        """Return the unsigned little-endian number in `size` bytes of data space, without side effects.

        `place` is a register (`U1STA`, `W3`), a variable, or any address; addresses from 0x8000 on are in the PSV
        window.
        Raises KeyError for an unknown name, ValueError for unimplemented addresses or less than one byte.
        """
        address = self.address_of(place)
        if size == 2 and not address & 1 and 0 <= address < self.record.data_end:
            return self.bus.peek(address) if address < self.bus.end else self.record.u16[address >> 1]
        return int.from_bytes(self.peek_bytes(address, size), "little")

    def peek_bytes(self, place: NameOrAddress, size: int) -> bytes:
        """Return `size` bytes of data space from `place`, without side effects. Raises as `peek`."""
        address = self.address_of(place)
        end = address + size
        if size < 1 or address < 0 or (end > self.record.data_end and (address < WINDOW or end > 2 * WINDOW)):
            raise ValueError(f"no {size} bytes of data space at {address:#06x}: it ends at {self.record.data_end:#x}")
        if address >= self.bus.end and end <= self.record.data_end:
            return bytes(self.record.bytes[address:end])
        words = (self._peek_word(word) for word in range(address & ~1, end, 2))
        first = address & 1
        return b"".join(word.to_bytes(2, "little") for word in words)[first : first + size]

    def _peek_word(self, address: int) -> int:
        if address < self.bus.end:
            return self.bus.peek(address)
        if address < self.record.data_end:
            return self.record.u16[address >> 1]
        return self.program.word(self.record.u16[self.core.state.at["PSVPAG"]] << 15 | address & 0x7FFE) & 0xFFFF

    def poke(self, place: NameOrAddress, value: int, size: int = 2) -> None:
        """Store the low `size` bytes of `value` at `place` in data space, without side effects or hook calls.

        Raises as `peek`. Constants in program memory cannot be changed.
        """
        address = self.address_of(place)
        if size < 1 or not 0 <= address <= self.record.data_end - size:
            raise ValueError(f"no {size} bytes of data space at {address:#06x}: it ends at {self.record.data_end:#x}")
        if self.memory_observer is not None:
            self.memory_observer.on_external_write(address, size)
        self.record.bytes[address : address + size] = (value & (1 << 8 * size) - 1).to_bytes(size, "little")

    def hook_sfr(self, place: NameOrAddress, hook: SfrHook) -> Callable[[], None]:
        """Call hook(is_write, word) after every access of an instruction to a register.

        Returns a function that removes the hook. Raises KeyError for an unknown name, ValueError for an address that is
        not a register.
        """
        address = self.address_of(place)
        if not 0 <= address < self.bus.end:
            raise ValueError(f"{place!r} is no register: registers lie below {self.bus.end:#x}")
        word = address >> 1
        if word not in self._sfr_hooks:
            self._sfr_hooks[word] = tap(self.bus, word)
            self.runner.forget()
        forget = self._sfr_hooks[word].add(hook)

        def remove() -> None:
            forget()
            if word in self._sfr_hooks and not self._sfr_hooks[word]:
                self._sfr_hooks.pop(word).remove()
                self.runner.forget()

        return remove
