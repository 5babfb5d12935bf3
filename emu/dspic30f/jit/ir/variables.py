"""Variables of translated code: registers and flags of the machine, kept outside the record while a function runs.

Each variable is an `alloca` that LLVM converts to host registers. The prologue loads the variables that a region uses
from the record. The exit block stores those that it writes and composes SR. Arithmetic flags are lazy (lazy_flags.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from emu.dspic30f.jit.ir.lazy_flags import FLAG_ENCODING, decode_flag, encode_flag
from emu.dspic30f.jit.ir.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.state.state import FLAGS, OAB, SAB

ACCUMULATOR_FLAGS: Final = ("OA", "OB", "SA", "SB")
BITS: Final = FLAGS | {"OAB": OAB.bit_length() - 1, "SAB": SAB.bit_length() - 1}
"""SR bits that are variables: the flags that rows name, and the summary flags OAB and SAB."""


class Variables:
    """Variables of one function in block code. `offset` holds the byte offsets of record fields by name."""

    def __init__(self, emitter: Emitter, offset: Mapping[str, int]) -> None:
        self._emitter: Final = emitter
        self._offset: Final = offset
        self._used: dict[str, None] = {}
        self._written: set[str] = set()
        self._known: dict[str, Value] = {}

    def new_block(self) -> None:
        """Discard the known SSA values of variables, because a new block may have several predecessors."""
        self._known.clear()

    def touch(self, *names: str) -> None:
        """Load the variables `names` and store them at the exit even if no instruction uses them."""
        for name in names:
            self._used.setdefault(name)
            self._written.add(name)

    def get(self, name: str) -> Value:
        """Return the current value of a variable.

        Names are "W0".."W15", the flags of `state.FLAGS`, accumulators "A0" and "A1", "cycle", "stall" and "pc".
        """
        self._used.setdefault(name)
        if name not in self._known:
            self._known[name] = self._loaded(self._emitter, name)
        return self._known[name]

    @staticmethod
    def _loaded(emitter: Emitter, name: str) -> Value:
        bit = name in BITS and name not in FLAG_ENCODING
        found = emitter.let(f"load {'i1' if bit else 'i64'}, ptr %x.{name}", bit)
        return decode_flag(name, found) if name in FLAG_ENCODING else found

    def set(self, name: str, value: Number) -> None:
        """Assign a variable."""
        self._used.setdefault(name)
        self._written.add(name)
        if name in FLAG_ENCODING:
            self._emitter.line(f"store i64 {encode_flag(self._emitter, name, value)}, ptr %x.{name}")
            self._known[name] = Value(self._emitter, truth(value), True)
            return
        bit = name in BITS
        text = truth(value) if bit else wide(value)
        self._emitter.line(f"store {'i1' if bit else 'i64'} {text}, ptr %x.{name}")
        self._known[name] = Value(self._emitter, text, bit)

    def leave(self, pc: Number, reason: int) -> None:
        """End the block: leave the function with exit reason `reason` and the given PC."""
        self._emitter.line(f"store i64 {wide(pc)}, ptr %x.pc")
        self._emitter.line(f"store i64 {reason}, ptr %x.reason")
        self._emitter.end("br label %exit")

    def set_flags(self, flags: Mapping[str, Number]) -> None:
        """Assign several flags and the summary flags computed from them."""
        for name, value in flags.items():
            self.set(name, value)
        if any(name in ACCUMULATOR_FLAGS for name in flags):
            self.set("OAB", self.get("OA") | self.get("OB"))
            self.set("SAB", self.get("SA") | self.get("SB"))

    def prologue(self, emitter: Emitter) -> None:
        """Declare and load all used variables in the function's first block, which is generated last."""
        for name in self._used:
            emitter.line(f"%x.{name} = alloca {'i1' if name in BITS and name not in FLAG_ENCODING else 'i64'}")
        sr = emitter.load(pointer(emitter, self._offset["SR"]), 16) if any(n in BITS for n in self._used) else None
        for name in self._used:
            if name in BITS:
                assert sr is not None
                bit = sr & (1 << BITS[name])
                if name in FLAG_ENCODING:
                    emitter.line(f"store i64 {encode_flag(emitter, name, bit)}, ptr %x.{name}")
                else:
                    emitter.line(f"store i1 {truth(bit)}, ptr %x.{name}")
            elif name[0] == "A":
                value = accumulator(emitter, self._offset["ACCBL" if name == "A1" else "ACCAL"])
                emitter.line(f"store i64 {value.text}, ptr %x.{name}")
            else:
                offset, bits = self._home(name)
                emitter.line(f"store i64 {emitter.load(pointer(emitter, offset), bits).text}, ptr %x.{name}")

    def write_back(self, emitter: Emitter) -> None:
        """Store all written variables, in the function's exit block."""
        flags = [name for name in BITS if name in self._written]
        if flags:
            self._write_sr(emitter, flags)
        for name in sorted(self._written - set(flags)):
            value = emitter.let(f"load i64, ptr %x.{name}")
            if name[0] == "A":
                base = self._offset["ACCBL" if name == "A1" else "ACCAL"]
                emitter.store(pointer(emitter, base), value, 32)
                emitter.store(pointer(emitter, base + 4), (value >> 32) & 0xFF, 16)
            else:
                offset, bits = self._home(name)
                emitter.store(pointer(emitter, offset), value, bits)

    def _write_sr(self, emitter: Emitter, flags: list[str]) -> None:
        place = pointer(emitter, self._offset["SR"])
        mask = sum(1 << BITS[name] for name in flags)
        word: Number = emitter.load(place, 16) & (0xFFFF & ~mask)
        for name in flags:
            word = word | (self._loaded(emitter, name) << BITS[name])
        emitter.store(place, word, 16)

    def _home(self, name: str) -> tuple[int, int]:
        if name[0] == "W":
            return 2 * int(name[1:]), 16
        return {
            "cycle": (self._offset["cpu.cycle"], 64),
            "stall": (self._offset["cpu.stall"], 16),
            "pc": (self._offset["cpu.pc"], 32),
        }[name]


class MemoryVariables(Variables):
    """Variables of exact code. They stay in the record, because native code may leave after every instruction."""

    def get(self, name: str) -> Value:
        """Emit a load from the record."""
        emitter = self._emitter
        if name in FLAGS:
            word = emitter.load(pointer(emitter, self._offset["SR"]), 16)
            return Value(emitter, truth(word & (1 << FLAGS[name])), True)
        if name[0] == "A":
            return accumulator(emitter, self._offset["ACCBL" if name == "A1" else "ACCAL"])
        offset, bits = self._home(name)
        return emitter.load(pointer(emitter, offset), bits)

    def set(self, name: str, value: Number) -> None:
        """Emit a store to the record."""
        emitter = self._emitter
        if name in FLAGS:
            self.set_flags({name: value})
        elif name[0] == "A":
            base = self._offset["ACCBL" if name == "A1" else "ACCAL"]
            emitter.store(pointer(emitter, base), value, 32)
            emitter.store(pointer(emitter, base + 4), (value >> 32) & 0xFF, 16)
        else:
            offset, bits = self._home(name)
            emitter.store(pointer(emitter, offset), value, bits)

    def set_flags(self, flags: Mapping[str, Number]) -> None:
        """Write several SR bits with one load and one store."""
        emitter = self._emitter
        place = pointer(emitter, self._offset["SR"])
        word: Number = emitter.load(place, 16) & (0xFFFF & ~sum(1 << FLAGS[name] for name in flags))
        for name, value in flags.items():
            word = word | (Value(emitter, truth(value), True) << FLAGS[name])
        if any(name in ACCUMULATOR_FLAGS for name in flags):
            word = _with_sums(emitter, word & (0xFFFF & ~(OAB | SAB)))
        emitter.store(place, word, 16)

    def leave(self, pc: Number, reason: int) -> None:
        """End the block: set PC and return exit reason `reason`."""
        self.set("pc", pc)
        self._emitter.end(f"ret i64 {reason}")

    def write_back(self, emitter: Emitter) -> None:
        """Do nothing, because the record is always up to date."""


def _with_sums(emitter: Emitter, word: Number) -> Number:
    """Return an SR value with OAB = OA | OB and SAB = SA | SB."""
    overflow = Value(emitter, truth(word & (1 << FLAGS["OA"] | 1 << FLAGS["OB"])), True)
    sticky = Value(emitter, truth(word & (1 << FLAGS["SA"] | 1 << FLAGS["SB"])), True)
    return word | (overflow << OAB.bit_length() - 1) | (sticky << SAB.bit_length() - 1)


def pointer(emitter: Emitter, offset: Number) -> str:
    """Emit a pointer to a byte offset in the record. Return its name."""
    name = emitter.name()
    emitter.line(f"{name} = getelementptr i8, ptr %rec, i64 {wide(offset)}")
    return name


def accumulator(emitter: Emitter, offset: int) -> Value:
    """Emit a load of an accumulator's 40 bits at byte offset `offset`, sign-extended."""

    low = emitter.load(pointer(emitter, offset), 32)
    high = emitter.load(pointer(emitter, offset + 4), 8)
    return ((low | (high << 32)) ^ (1 << 39)) - (1 << 39)
