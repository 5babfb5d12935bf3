"""A measuring application under control: stops, words of its request and result, snapshots between cases.

What enters: an image with the symbols of one of the kernel's measuring applications. What leaves: a machine that stands
where it is wanted, and numbers read from its memory without side effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from emu.image.model import Image
from emu.machine.machine import Machine

WORD: Final = 2
PATIENCE: Final = 50_000_000
"""Tcy after which a stop that was not reached will not be."""


class MeasureError(Exception):
    """The application did not do what its README says."""


class Target:
    """A machine with a measuring application. `begin` is the symbol of the stop at which requests are set."""

    def __init__(self, image: Image, begin: str, engine: str) -> None:
        self.image: Final = image
        self.machine: Final = Machine(image.chip, engine=engine)
        self.machine.load(image)
        self.run_to(begin)
        self._start: Final = self.machine.snapshot()

    def restart(self) -> None:
        """Back to the `begin` stop."""
        self.machine.restore(self._start)

    def address(self, name: str) -> int:
        """Address of a symbol. Raises MeasureError if the image lacks it."""
        symbol = self.image.symbols.find(name)
        if symbol is None:
            raise MeasureError(f"{self.image.path} has no symbol {name!r}")
        return symbol.address

    def size(self, name: str) -> int:
        """Size of a symbol in its own units; up to the next symbol where the compiler tells none."""
        symbol = self.image.symbols.find(name)
        if symbol is None or symbol.size:
            return symbol.size if symbol is not None else 0
        behind = (s.address for s in self.image.symbols.all if s.space == symbol.space and s.address > symbol.address)
        return min(behind, default=symbol.address) - symbol.address

    def word(self, address: int) -> int:
        """A word of RAM."""
        return self.machine.peek(address)

    def words(self, name: str, count: int) -> list[int]:
        """The first words of a variable."""
        address = self.address(name)
        return [self.word(address + WORD * index) for index in range(count)]

    def set_words(self, name: str, values: Sequence[int]) -> None:
        """Set the first words of a variable."""
        address = self.address(name)
        for index, value in enumerate(values):
            self.machine.poke(address + WORD * index, value)

    def run_to(self, name: str) -> None:
        """Run until the program counter stands at a symbol. Raises MeasureError if that does not happen."""
        address = self.address(name)
        remove = self.machine.hook_pc(address, lambda: True)
        try:
            stop = self.machine.run(cycles=PATIENCE)
        finally:
            remove()
        if stop.reason != "breakpoint" or stop.pc != address:
            where = self.image.symbols.text(stop.pc)
            raise MeasureError(f"{self.image.path}: {name} was not reached: {stop.reason} at {where} {stop.detail}")
