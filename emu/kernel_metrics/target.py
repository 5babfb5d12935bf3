"""Control of a measuring application: stops, request and result words, snapshots between cases.

Input: an image with the symbols of one of the kernel's measuring applications. Output: a machine stopped at a symbol,
and numbers read from its memory without side effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from emu.image.model import Image
from emu.machine.machine import Machine

WORD: Final = 2
STOP_TIMEOUT_CYCLES: Final = 50_000_000
"""Tcy after which a stop counts as not reachable."""


class MeasureError(Exception):
    """The application did not behave as its README specifies."""


def address_of(image: Image, name: str) -> int:
    """Return the address of a symbol. Raises MeasureError if the image lacks it."""
    symbol = image.symbols.find(name)
    if symbol is None:
        raise MeasureError(f"{image.path} has no symbol {name!r}")
    return symbol.address


def size_of(image: Image, name: str) -> int:
    """Return the size of a symbol in its own units. If none is recorded, return the distance to the next symbol."""
    symbol = image.symbols.find(name)
    if symbol is None or symbol.size:
        return symbol.size if symbol is not None else 0
    behind = (s.address for s in image.symbols.all if s.space == symbol.space and s.address > symbol.address)
    return min(behind, default=symbol.address) - symbol.address


class Target:
    """A machine that runs a measuring application. `begin` is the symbol of the stop at which requests are written."""

    def __init__(self, image: Image, begin: str, engine: str) -> None:
        self.image: Final = image
        self.machine: Final = Machine(image.chip, engine=engine)
        self.machine.load(image)
        self.run_to(begin)
        self._start: Final = self.machine.snapshot()

    def restart(self) -> None:
        """Restore the state of the stop `begin`."""
        self.machine.restore(self._start)

    def address(self, name: str) -> int:
        """Return the address of a symbol. Raises MeasureError if the image lacks it."""
        return address_of(self.image, name)

    def size(self, name: str) -> int:
        """Return the size of a symbol in its own units. If none is recorded, return the distance to the next symbol."""
        return size_of(self.image, name)

    def word(self, address: int) -> int:
        """Return a word of RAM."""
        return self.machine.peek(address)

    def words(self, name: str, count: int) -> list[int]:
        """Return the first words of a variable."""
        address = self.address(name)
        return [self.word(address + WORD * index) for index in range(count)]

    def set_words(self, name: str, values: Sequence[int]) -> None:
        """Set the first words of a variable."""
        address = self.address(name)
        for index, value in enumerate(values):
            self.machine.poke(address + WORD * index, value)

    def run_to(self, name: str) -> None:
        """Run until the PC reaches a symbol. Raises MeasureError if it does not."""
        address = self.address(name)
        remove = self.machine.hook_pc(address, lambda: True)
        try:
            stop = self.machine.run(cycles=STOP_TIMEOUT_CYCLES)
        finally:
            remove()
        if stop.reason != "breakpoint" or stop.pc != address:
            where = self.image.symbols.text(stop.pc)
            raise MeasureError(f"{self.image.path}: {name} was not reached: {stop.reason} at {where} {stop.detail}")
