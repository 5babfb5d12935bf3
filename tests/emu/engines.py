"""Adapters that run recorded vectors on the instruction table alone and on each engine."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from emu.dspic30f.engines import NAMES
from emu.dspic30f.jit.cache import ObjectCache
from emu.dspic30f.jit.compiler import Compiler
from emu.dspic30f.jit.engine import JitEngine
from emu.machine.machine import Machine
from tests.emu.rowmachine import REGISTERS, RowMachine

RAM_START, RAM_END = 0x0800, 0x2800
CORE = ("TBLPAG", "MODCON", "XMODSRT", "XMODEND", "YMODSRT", "YMODEND", "XBREV")
MASK40 = (1 << 40) - 1


class Engine(Protocol):
    """Interface of a runner of vectors."""

    name: str

    def prepare(self, vector: dict[str, Any]) -> None:
        """Load program, registers and memory. Values that are not listed are 0, and unlisted program words are NOP."""

    def step(self) -> None:
        """Run one instruction, or one iteration of a REPEAT target."""

    @property
    def pc(self) -> int: ...

    def w(self, n: int) -> int: ...

    def register(self, name: str) -> int:
        """Return SR or CORCON."""

    def accumulator(self, name: str) -> int:
        """Return ACCA or ACCB as 40 unsigned bits."""

    def ram(self) -> bytes:
        """Return the bytes of data addresses 0x0800-0x27FF."""


def program_of(vector: dict[str, Any]) -> dict[int, int]:
    """Return the program words by address."""
    words = {vector["pc"] + 2 * i: int(word, 16) for i, word in enumerate(vector["op"])}
    return words | {int(address, 16): int(word, 16) for address, word in vector["in"].get("prog", {}).items()}


class Rows:
    """The instruction table without a machine."""

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


class NoCache(ObjectCache):
    """Cache that is always empty, so that the JIT compiles the code of every vector."""

    def get(self, key: str) -> bytes | None:
        return None

    def put(self, key: str, content: bytes) -> None:
        """Ignore the code."""


class OnMachine:
    """A machine with one of its engines. Flash words that no vector sets are 0 (NOP)."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.machine = Machine(engine=name)
        if isinstance(self.machine.runner, JitEngine):  # compiles every instruction before it runs it
            self.machine.runner.threshold, self.machine.runner.wait = 1, True
            self.machine.runner.compiler = Compiler(NoCache())
        for half in range(len(self.machine.program.flash)):
            self.machine.program.flash[half] = 0
        self.machine.program.announce_all()
        for n in range(16):
            self.machine.w[n] = 0
        flash = self.machine.record.fields["program.flash"]
        self.state = (slice(0, flash.offset), slice(flash.offset + 4 * flash.count, self.machine.record.used))
        self.clean = [bytes(self.machine.record.bytes[part]) for part in self.state]
        self.used: list[int] = []

    def prepare(self, vector: dict[str, Any]) -> None:
        m, state = self.machine, vector["in"]
        program = program_of(vector)
        for address in self.used:
            m.program.flash[address >> 1] = 0
        for address, word in program.items():
            m.program.flash[address >> 1] = word
        self.used = list(program)
        m.program.announce_all()  # once per vector: engines discard their code at each call
        for part, content in zip(self.state, self.clean, strict=True):  # all parts except flash, which is large
            m.record.bytes[part] = content
        for n, value in enumerate(state["W"]):
            m.w[n] = value
        for name in ("SR", "CORCON"):
            m.poke(name, state[name])
        for name in CORE:
            m.poke(name, state.get(name, 0))
        for name in ("ACCA", "ACCB"):
            for i, part in enumerate("LHU"):
                m.poke(name + part, state.get(name, 0) >> 16 * i & 0xFFFF)
        for address, value in state.get("mem", {}).items():
            m.poke(int(address, 16), value)
        m.pc = vector["pc"]

    def step(self) -> None:
        stop = self.machine.run_until(self.machine.cycle + 1)
        assert stop is None, stop

    @property
    def pc(self) -> int:
        return self.machine.pc

    def w(self, n: int) -> int:
        return self.machine.w[n]

    def register(self, name: str) -> int:
        return self.machine.peek(name)

    def accumulator(self, name: str) -> int:
        low, high, upper = (self.machine.peek(name + part) for part in "LHU")
        return low | high << 16 | (upper & 0xFF) << 32

    def ram(self) -> bytes:
        return bytes(self.machine.record.bytes[RAM_START:RAM_END])


ENGINES: dict[str, Callable[[], Engine]] = {"rows": Rows} | {
    name: partial(OnMachine, name) for name in NAMES if name != "auto"
}
