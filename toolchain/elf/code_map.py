"""Code of a linked image: instructions by address, starts of functions, vectors, functions whose address is taken."""

from __future__ import annotations

from typing import Final

from emu.chips import chip_named, chip_of
from emu.chips.family import AIVT, SLOTS
from emu.dspic30f.isa.facts import flow_of
from emu.dspic30f.isa.flow import Call, Goto
from emu.image.elf_facts import PROCESSOR_MASK
from toolchain.elf import constants as c
from toolchain.elf.disassemble import NO_INSTRUCTIONS, CodeItem, Names, items
from toolchain.elf.model import Bind, Executable, Symbol
from toolchain.elf.symbols import is_named
from toolchain.errors import ToolError

HANDLES = ".handle"
"""Section of the jumps to functions whose address is taken (abi-elf.md §1.5)."""
TABLES = NO_INSTRUCTIONS | {HANDLES}


class CodeMap:
    """Code of one image. Functions are identified by their start addresses, the elements of `entries`."""

    def __init__(self, image: Executable) -> None:
        self.image: Final = image
        self.chip: Final = chip_of(image.processor & PROCESSOR_MASK) or chip_named()
        self.code: Final[dict[int, CodeItem]] = {}
        for section in image.sections:
            if section.is_code and section.name not in TABLES and section.address in self.chip.program["program"]:
                self.code.update((item.address, item) for item in items(section))
        self.names: Final = Names(image.symbols)
        self.vectors: Final = self._vectors()
        self.handles: Final = self._handle_targets()
        """Functions whose address is taken."""
        self.entries: Final = self._entries()

    def _vectors(self) -> dict[int, list[str]]:
        """Return vector names by handler address, from the vector tables of the image."""
        words: dict[int, int] = {}
        for section in self.image.sections:
            if section.is_code and section.address < AIVT.end:
                words.update((item.address, item.words[0]) for item in items(section))
        found: dict[int, list[str]] = {}
        for vector in SLOTS:
            for address in (vector.ivt, vector.aivt):
                handler = words.get(address, 0)
                if handler in self.code and vector.name not in found.setdefault(handler, []):
                    found[handler].append(vector.name)
        return {handler: names for handler, names in found.items() if names}

    def _handle_targets(self) -> set[int]:
        slots = [i for s in self.image.sections if s.name == HANDLES for i in items(s)]
        jumps = [flow_of(i.insn, i.address) for i in slots if i.insn is not None]
        return {jump.target for jump in jumps if isinstance(jump, Goto) and isinstance(jump.target, int)}

    def _entries(self) -> set[int]:
        """Return function starts: FUNC symbols, call targets, vectors, the program's entry."""
        found = {self.image.entry, *self.vectors, *self.handles}
        for symbol in self.image.symbols:
            if symbol.section is not None and symbol.section.is_code and is_named(symbol):
                typed = symbol.type == c.STT_FUNC or (symbol.type == c.STT_NOTYPE and symbol.bind is not Bind.LOCAL)
                if typed and symbol.value in self.code and self.code[symbol.value].insn is not None:
                    found.add(symbol.value)
        for item in self.code.values():
            if item.insn is not None and item.insn.row.mnemonic in ("CALL", "RCALL"):
                match flow_of(item.insn, item.address):
                    case Call(target) if isinstance(target, int):
                        found.add(target)
        return found & set(self.code)

    def symbol(self, address: int) -> tuple[Symbol, int] | None:
        """Return the nearest symbol of a program address and the distance from it, None without one."""
        return self.names.find(address, "code")

    def name(self, address: int) -> str:
        """Return the nearest symbol of a program address, with the distance from it."""
        found = self.symbol(address)
        if found is None:
            return f"{address:#x}"
        symbol, distance = found
        return f"{symbol.name}+{distance:#x}" if distance else symbol.name

    def named(self, name: str) -> int:
        """Return the address of a function named in C or assembly spelling; raises `ToolError`."""
        for symbol in self.image.symbols:
            if symbol.name in (name, "_" + name) and symbol.section is not None and symbol.section.is_code:
                return symbol.value
        raise ToolError(f"no function is called {name}")
