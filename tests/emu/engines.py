"""What a vector needs of an engine, and the engines there are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from rowmachine import REGISTERS, RowMachine

RAM_START, RAM_END = 0x0800, 0x2800
CORE = ("TBLPAG", "MODCON", "XMODSRT", "XMODEND", "YMODSRT", "YMODEND", "XBREV")
MASK40 = (1 << 40) - 1


class Engine(Protocol):
    """Runs vectors one after the other."""

    name: str

    def prepare(self, vector: dict[str, Any]) -> None:
        """Load program, registers and memory; everything not listed is 0, unlisted program words are NOP."""

    def step(self) -> None:
        """One instruction, or one iteration of a REPEAT target."""

    @property
    def pc(self) -> int: ...

    def w(self, n: int) -> int: ...

    def register(self, name: str) -> int:
        """SR or CORCON."""

    def accumulator(self, name: str) -> int:
        """ACCA or ACCB, unsigned 40 bits."""

    def ram(self) -> bytes:
        """Data addresses 0x0800-0x27FF."""


def program_of(vector: dict[str, Any]) -> dict[int, int]:
    """Program words by address."""
    words = {vector["pc"] + 2 * i: int(word, 16) for i, word in enumerate(vector["op"])}
    return words | {int(address, 16): int(word, 16) for address, word in vector["in"].get("prog", {}).items()}


class Rows:
    """The table alone."""

    name = "rows"

    def prepare(self, vector: dict[str, Any]) -> None:
        self.m = RowMachine(program_of(vector))
        self.m.pc = vector["pc"]
        state = vector["in"]
        for n, value in enumerate(state["W"]):
            self.m.set_w(n, value)
        for name in ("SR", "CORCON"):
            self.m.put(REGISTERS[name], state[name])
        for name in CORE:
            self.m.put(REGISTERS[name], state.get(name, 0))
        for i, name in enumerate(("ACCA", "ACCB")):
            value = state.get(name, 0)
            self.m.set_acc(i, value - (value >> 39 << 40))
        for address, value in state.get("mem", {}).items():
            self.m.put(int(address, 16), value)

    def step(self) -> None:
        self.m.step()

    @property
    def pc(self) -> int:
        return self.m.pc

    def w(self, n: int) -> int:
        return self.m.w(n)

    def register(self, name: str) -> int:
        return self.m.get(REGISTERS[name])

    def accumulator(self, name: str) -> int:
        return self.m.acc("AB".index(name[-1])) & MASK40

    def ram(self) -> bytes:
        return bytes(self.m.data[RAM_START:RAM_END])


ENGINES: dict[str, Callable[[], Engine]] = {"rows": Rows}
