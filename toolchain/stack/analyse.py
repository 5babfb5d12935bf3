"""The call graph, and the worst-case stack per function and per entry."""

from __future__ import annotations

from dataclasses import dataclass

from emu.chips import chip_named, chip_of
from emu.chips.family import AIVT, SLOTS
from emu.image.elf_facts import PROCESSOR_MASK
from toolchain.elf import constants as c
from toolchain.elf.disassemble import NO_INSTRUCTIONS, CodeItem, Names, items
from toolchain.elf.model import Bind, Executable
from toolchain.elf.symbols import is_named
from toolchain.errors import ToolError
from toolchain.stack.annotations import Annotations
from toolchain.stack.effects import CALL_BYTES, Successor, effect_of
from toolchain.stack.totals import Usage, totals
from toolchain.stack.walk import CallSite, FunctionStack, Walker

TABLES = NO_INSTRUCTIONS | {".handle"}
ANY = "*"  # target in an annotation that stands for any function whose address is taken


@dataclass(slots=True)
class Entry:
    """An entry: "reset", "interrupt", "thread" or "pointer" (never called directly)."""

    kind: str
    usage: Usage
    extra: int = 0  # bytes that the hardware pushes at entry

    @property
    def total(self) -> int:
        return self.usage.total + self.extra

    @property
    def before_switch(self) -> int | None:
        """Bytes on the interrupted stack if the handler switches to a stack of its own, None if it does not."""
        return None if self.usage.switch is None else self.usage.switch + self.extra


@dataclass(slots=True)
class StackReport:
    functions: list[Usage]
    entries: list[Entry]


class Analysis:
    """Stack analysis of one image; `report()` returns the result."""

    def __init__(self, image: Executable, annotations: Annotations) -> None:
        self.image, self.annotations = image, annotations
        self.code: dict[int, CodeItem] = {}
        chip = chip_of(image.processor & PROCESSOR_MASK) or chip_named()
        for section in image.sections:
            if section.is_code and section.name not in TABLES and section.address in chip.program["program"]:
                self.code.update((item.address, item) for item in items(section))
        self.names = Names(image.symbols)
        self.vectors = self._vectors()
        self.handles = self._handle_targets()
        self.entries = self._entries()
        self.functions = self._walk_all()

    # -- entries -------------------------------------------------------------------------------------------------

    def _vectors(self) -> dict[int, str]:
        """Return vector names by handler address, from the vector tables of the image."""
        words: dict[int, int] = {}
        for section in self.image.sections:
            if section.is_code and section.address < AIVT.end:
                words.update((item.address, item.words[0]) for item in items(section))
        found: dict[int, list[str]] = {}
        for vector in SLOTS:
            for address, name in ((vector.ivt, vector.name), (vector.aivt, "Alt" + vector.name)):
                handler = words.get(address, 0)
                if handler in self.code and name.removeprefix("Alt") not in found.setdefault(handler, []):
                    found[handler].append(name)
        return {handler: " ".join(names) for handler, names in found.items() if names}

    def _entries(self) -> set[int]:
        """Return function starts: FUNC symbols, call targets, vectors, the program's entry, annotated names."""
        found = {self.image.entry, *self.vectors, *self.handles}
        found |= {self._named(name) for name in self.annotations.threads}
        for symbol in self.image.symbols:
            if symbol.section is not None and symbol.section.is_code and is_named(symbol):
                typed = symbol.type == c.STT_FUNC or (symbol.type == c.STT_NOTYPE and symbol.bind is not Bind.LOCAL)
                if typed and symbol.value in self.code and self.code[symbol.value].insn is not None:
                    found.add(symbol.value)
        for item in self.code.values():
            if item.insn is not None and (effect := effect_of(item.insn, item.address)).flow is Successor.CALL:
                found.add(effect.target)
        return found & set(self.code)

    def _walk_all(self) -> dict[int, FunctionStack]:
        walker = Walker(self.code, self.entries)
        return {entry: walker.walk(entry) for entry in sorted(self.entries)}

    def name(self, address: int) -> str:
        """Return the nearest symbol of an address, with the distance from it."""
        found = self.names.find(address, "code")
        if found is None:
            return f"{address:#x}"
        symbol, distance = found
        return f"{symbol.name}+{distance:#x}" if distance else symbol.name

    def _named(self, name: str) -> int:
        """Return the address of a function named in C or assembly spelling; raises `ToolError`."""
        for symbol in self.image.symbols:
            if symbol.name in (name, "_" + name) and symbol.section is not None and symbol.section.is_code:
                return symbol.value
        raise ToolError(f"no function is called {name}")

    def annotation(self, table: dict[str, int], entry: int) -> int | None:
        """Return the annotated number of the function at `entry`, None without one."""
        name = self.name(entry)
        return table.get(name, table.get(name.removeprefix("_")))

    # -- calls ---------------------------------------------------------------------------------------------------

    def targets(self, call: CallSite) -> list[int]:
        """Return the functions that a call site may reach: its target, or the annotated targets of a pointer call."""
        if call.target is not None:
            return [call.target] if call.target else []  # address 0: an undefined weak function
        owner = self.name(call.address).partition("+")[0]
        names = self.annotations.calls.get(owner) or self.annotations.calls.get(owner.removeprefix("_")) or []
        if not names and self.annotations.any_handle:
            names = [ANY]
        return [a for name in names for a in (self._handles() if name == ANY else [self._named(name)])]

    def _handles(self) -> list[int]:
        """Return the functions whose address is taken, by `.handle` (abi-elf.md §1.5); raises `ToolError`."""
        if not any(s.name == ".handle" for s in self.image.sections):
            raise ToolError("the image has no .handle section, which lists functions whose address is taken")
        return sorted(self.handles & self.entries)

    def _handle_targets(self) -> set[int]:
        slots = [i for s in self.image.sections if s.name == ".handle" for i in items(s)]
        jumps = [effect_of(i.insn, i.address) for i in slots if i.insn is not None]
        return {jump.target for jump in jumps if jump.flow is Successor.JUMP}

    def report(self) -> StackReport:
        """Return all functions, and the entries: reset, interrupts, threads, and functions reached only by pointer."""
        usages = totals(self)
        called = {t for f in self.functions.values() for call in f.calls for t in self.targets(call)}
        threads = [self._named(name) for name in self.annotations.threads]
        entries = [Entry("reset", usages[self.image.entry])]
        entries += [Entry("interrupt", usages[handler], CALL_BYTES) for handler in sorted(self.vectors)]
        entries += [Entry("thread", usages[address]) for address in dict.fromkeys(threads)]
        listed = {entry.usage.entry for entry in entries}
        entries += [Entry("pointer", usages[address]) for address in sorted(self.entries - called - listed)]
        return StackReport([usages[entry] for entry in sorted(self.functions)], entries)


__all__ = ["Analysis", "Entry", "StackReport", "Usage"]
