"""One image, ready to be explored: its code, constants and annotations."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Final

from emu.chips import chip_named, chip_of
from emu.image.elf_facts import PROCESSOR_MASK
from toolchain.bounds.abstract.state import State
from toolchain.bounds.abstract.values import WINDOW
from toolchain.bounds.annotations.bindings import Bindings
from toolchain.bounds.annotations.names import Names
from toolchain.bounds.annotations.notes import Note, Notes
from toolchain.bounds.annotations.sources import Sources
from toolchain.bounds.graph import Builder
from toolchain.bounds.signatures import Signatures
from toolchain.elf.disassemble import items
from toolchain.elf.model import Executable
from toolchain.errors import ToolError
from toolchain.stack.analyse import Analysis
from toolchain.stack.annotations import Annotations

PAGE = 0x8000
UNUSED = "__DefaultInterrupt"
"""Handler of vectors without one: it does not come back."""
RESET_LEVEL = 4
"""Priority of every interrupt after a reset (isa.md §2.1)."""
PYTHON_DEPTH = 20_000
"""Frames of Python that deep calls of the firmware may take."""


def _beside(note: Note) -> str:
    """The file a note names in its own folder; without a name its own."""
    name = note.text[1:].strip()
    return note.file.rpartition("/")[0] + "/" + name if name else note.file


class Program:
    """What an image says about itself, and what its notes answer (explore.Rules)."""

    def __init__(self, image: Executable, annotations: Annotations, notes: Notes, left_out: Iterable[str] = ()) -> None:
        sys.setrecursionlimit(max(sys.getrecursionlimit(), PYTHON_DEPTH))
        self.image, self.notes, self.left_out = image, notes, left_out
        self.chip: Final = chip_of(image.processor & PROCESSOR_MASK) or chip_named()
        self.calls: Final = Analysis(image, annotations)
        self.graph: Final = Builder(self.calls.code, self.calls.entries)
        self.words: Final = {
            item.address + 2 * i: word
            for section in image.sections
            if section.is_code
            for item in items(section)
            for i, word in enumerate(item.words)
        }
        self.window: Final = self._window()
        debug = {s.name: bytes(s.data) for s in image.sections if s.name.startswith(".debug_")}
        self.sources: Final = Sources(debug)
        self.signatures: Final = Signatures(debug)
        self.names: Final = Names(image, self.sources, self.chip, self.calls.entries)
        self.bindings: Final = Bindings(notes, self.sources, self.names, self.calls.code)
        self._ram = {file for note in notes.of("ram") for file in self.sources.files(_beside(note))}

    def _window(self) -> dict[int, int] | None:
        """Bytes of the PSV window; None if no section lies in it, nothing if its page changes."""
        sections = [s for s in self.image.sections if s.is_psv and s.data]
        if not sections:
            return None
        if len({s.load // PAGE for s in sections}) > 1:
            return {}
        found: dict[int, int] = {}
        for section in sections:
            base = WINDOW | section.address & PAGE - 1
            low = (octet for i, octet in enumerate(section.data) if not i & 2)  # of each word; above is what PSV hides
            found.update(enumerate(low, base))
        return found

    def place(self, pc: int) -> str:
        """Source line of an address, or its symbol."""
        line = self.sources.lines.find(pc)
        return f"{line} ({self.calls.name(pc)})" if line else self.calls.name(pc)

    def address(self, name: str, note: Note | None = None) -> int | None:
        """Value of a symbol in C or assembly spelling, or the address of a register (Names.find)."""
        return self.names.find(name, note)

    def interesting(self, prefix: str) -> list[str]:
        """Functions of that prefix, else main."""
        entries = self.calls.entries
        found = {s.name for s in self.image.symbols if s.name.startswith(prefix) and s.value in entries}
        return sorted(found) or [name for name in ("_main",) if self.address(name) in entries]

    # -- what notes answer ---------------------------------------------------------------------------------------

    def links_in_ram(self, pc: int) -> bool:
        """Whether the code there finds only RAM behind pointers it loads."""
        return bool(self._ram) and self.sources.at(pc)[0] in self._ram

    def targets(self, pc: int, state: State) -> list[int] | None:
        """Where a call through a pointer can lead, by CALL_TARGETS in front of it or by an annotation file."""
        found: set[int] = set()
        for note in self.bindings.pointed(pc):
            for name in (part.strip() for part in note.text.split(",")):
                if name.startswith("-"):
                    found.discard(self.address(name[1:].strip(), note) or 0)
                elif name in self.signatures.types:
                    wanted = self.signatures.types[name]
                    found |= {a for a in self._taken() if self.signatures.functions.get(a) == wanted}
                else:
                    address = self.address(name, note)
                    if address is None:
                        raise ToolError(f"{note.place}: {name} is neither a function nor a type of one")
                    found.add(address)
            return sorted(found)
        owner = self.calls.name(pc).partition("+")[0]
        names = self.calls.annotations.calls
        listed = names.get(owner) or names.get(owner.removeprefix("_"))
        return [self.calls._named(name) for name in listed] if listed else None

    def threads(self) -> list[int]:
        """Functions that become threads: of a type THREADS names, or annotated."""
        found = {self.calls._named(name) for name in self.calls.annotations.threads}
        for note in self.notes.of("threads"):
            for name in note.text.split(","):
                wanted = self.signatures.types.get(name.strip())
                found |= {a for a in self._taken() if wanted is not None and self.signatures.functions.get(a) == wanted}
        return sorted(found)

    def interrupts(self) -> list[tuple[int, str, int]]:
        """Handler, name and level of everything that has a handler: of traps above 7, told by INTERRUPT_LEVEL or
        `os_level_of_`, else that after a reset. A handler of several vectors is there once for each."""
        traps = {vector.name: vector.level for vector in self.chip.vectors if vector.irq is None}
        told = self._told()
        found: dict[tuple[int, str], int] = {}
        for handler, vectors in self.calls.vectors.items():
            name = self.calls.name(handler)
            if name == UNUSED:
                continue
            plain = list(dict.fromkeys(vector.removeprefix("Alt") for vector in vectors.split()))
            for vector in plain:
                level = traps.get(vector, told.get(vector.removesuffix("Interrupt"), RESET_LEVEL))
                found[handler, name if len(plain) == 1 else "__" + vector] = level
        return [(handler, name, level) for (handler, name), level in found.items()]

    def priorities(self) -> dict[int, list[tuple[int, str, int]]]:
        """By register that gives priorities: shift, name and told level of each interrupt that has a handler."""
        told = self._told()
        handled = {
            vector.removeprefix("Alt")
            for handler, names in self.calls.vectors.items()
            if self.calls.name(handler) != UNUSED
            for vector in names.split()
        }
        found: dict[int, list[tuple[int, str, int]]] = {}
        for vector in self.chip.vectors:
            if vector.irq is not None and vector.name in handled and vector.irq in self.chip.interrupts:
                register, shift = self.chip.interrupts[vector.irq].priority
                source = vector.name.removesuffix("Interrupt")
                field = shift, source, told.get(source, RESET_LEVEL)
                found.setdefault(self.chip.sfrs[register].address, []).append(field)
        return found

    def enables(self) -> frozenset[int]:
        """Registers that enable interrupts."""
        return frozenset(self.chip.sfrs[source.enable[0]].address for source in self.chip.interrupts.values())

    def _told(self) -> dict[str, int]:
        """Levels told, by source."""
        told: dict[str, int] = {}
        for note in self.notes.of("level"):
            name, _, text = note.text.partition(" ")
            number = self.notes.number(text, note)
            if number is not None:
                told[name] = number
        for symbol in self.image.symbols:
            if symbol.name.startswith("os_level_of_"):
                told[symbol.name.removeprefix("os_level_of_")] = symbol.value
        return told

    def outside(self) -> set[int]:
        """Handlers of OUTSIDE_ONLY."""
        names = {name.strip() + "Interrupt" for note in self.notes.of("outside") for name in note.text.split(",")}
        return {handler for handler, found in self.calls.vectors.items() if names & set(found.split())}

    def without(self) -> frozenset[int]:
        """Functions to leave out, by name; raises `ToolError` for one that is not there."""
        found = set()
        for name in self.left_out:
            address = self.address(name)
            if address not in self.calls.entries:
                raise ToolError(f"no function is called {name}")
            found.add(address)
        return frozenset(found)

    def _taken(self) -> set[int]:
        """Functions whose address is taken."""
        return self.calls.handles

    def comes_back(self, entry: int) -> int | None:
        """Level at which a function that changes stacks returns, by COMES_BACK."""
        for note in self.notes.of("back"):
            name, _, level = note.text.partition(" ")
            if self.address(name, note) == entry:
                return self.notes.number(level, note)
        return None

    def switches(self, entry: int) -> bool:
        """Whether code moves to stacks of others, by STACK_AREA, COMES_BACK or RESUMED_BY; longjmp does not."""
        told = any(self.notes.of(kind) for kind in ("stack", "back", "resumed"))
        return told and entry != self.address("_longjmp")

    def resumed(self) -> list[int]:
        """Functions of RESUMED_BY."""
        said = [(name.strip(), note) for note in self.notes.of("resumed") for name in note.text.split(",")]
        return [a for name, note in said if (a := self.address(name, note)) is not None]

    def recursion(self, entry: int) -> int | None:
        """Activations of a function that exist at once, by annotation."""
        return self.calls.annotation(self.calls.annotations.recursion, entry)
