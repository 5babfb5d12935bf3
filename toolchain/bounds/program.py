"""The analysed image: code, constants, symbols and annotations."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Final

from emu.chips import chip_named, chip_of
from emu.image.elf_facts import PROCESSOR_MASK
from toolchain.bounds.abstract.state import AbstractState
from toolchain.bounds.abstract.values import WINDOW
from toolchain.bounds.annotations.bindings import AnnotationBindings
from toolchain.bounds.annotations.names import NameResolver
from toolchain.bounds.annotations.reader import Annotation, AnnotationSet
from toolchain.bounds.annotations.source_map import SourceMap
from toolchain.bounds.graph import GraphBuilder
from toolchain.bounds.signatures import Signatures
from toolchain.elf.disassemble import items
from toolchain.elf.model import Executable
from toolchain.errors import ToolError
from toolchain.stack.analyse import Analysis
from toolchain.stack.annotations import Annotations

PAGE = 0x8000
UNUSED = "__DefaultInterrupt"
"""Default handler of unused vectors; it does not return."""
RESET_LEVEL = 4
"""Priority of every interrupt after a reset (isa.md §2.1)."""
PYTHON_DEPTH = 20_000
"""Recursion limit of Python; the analysis recurses with the calls of the firmware."""


def _neighbour_file(annotation: Annotation) -> str:
    """Return the path of the file that an annotation names, relative to its own file; without a name, its own file."""
    name = annotation.text[1:].strip()
    return annotation.file.rpartition("/")[0] + "/" + name if name else annotation.file


class Program:
    """Facts of an image, and its annotations as implementations of the queries of `FlowFacts`."""

    def __init__(
        self,
        image: Executable,
        stack_annotations: Annotations,
        annotations: AnnotationSet,
        excluded_names: Iterable[str] = (),
    ) -> None:
        sys.setrecursionlimit(max(sys.getrecursionlimit(), PYTHON_DEPTH))
        self.image, self.annotations, self.excluded_names = image, annotations, excluded_names
        self.chip: Final = chip_of(image.processor & PROCESSOR_MASK) or chip_named()
        self.calls: Final = Analysis(image, stack_annotations)
        self.graph: Final = GraphBuilder(self.calls.code, self.calls.entries)
        self.words: Final = {
            item.address + 2 * i: word
            for section in image.sections
            if section.is_code
            for item in items(section)
            for i, word in enumerate(item.words)
        }
        self.window: Final = self._window()
        debug = {s.name: bytes(s.data) for s in image.sections if s.name.startswith(".debug_")}
        self.sources: Final = SourceMap(debug)
        self.signatures: Final = Signatures(debug)
        self.names: Final = NameResolver(image, self.sources, self.chip, self.calls.entries)
        self.bindings: Final = AnnotationBindings(annotations, self.sources, self.names, self.calls.code)
        self._ram = {
            file
            for annotation in annotations.of("ram")
            for file in self.sources.matching_files(_neighbour_file(annotation))
        }

    def _window(self) -> dict[int, int] | None:
        """Return the bytes of the PSV window; None without PSV sections, empty if they are on several pages."""
        sections = [s for s in self.image.sections if s.is_psv and s.data]
        if not sections:
            return None
        if len({s.load // PAGE for s in sections}) > 1:
            return {}
        found: dict[int, int] = {}
        for section in sections:
            base = WINDOW | section.address & PAGE - 1
            low = (octet for i, octet in enumerate(section.data) if not i & 2)  # PSV maps the low 16 bits of words
            found.update(enumerate(low, base))
        return found

    def place(self, pc: int) -> str:
        """Return the source line of an address, or its symbol."""
        line = self.sources.lines.find(pc)
        return f"{line} ({self.calls.name(pc)})" if line else self.calls.name(pc)

    def address(self, name: str, annotation: Annotation | None = None) -> int | None:
        """Return the address of a symbol, in C or assembly spelling, or of a register."""
        return self.names.find(name, annotation)

    def default_functions(self, prefix: str) -> list[str]:
        """Return the functions with a prefix, or main if there are none."""
        entries = self.calls.entries
        found = {s.name for s in self.image.symbols if s.name.startswith(prefix) and s.value in entries}
        return sorted(found) or [name for name in ("_main",) if self.address(name) in entries]

    # -- queries of FlowFacts ----------------------------------------------------------------------------------------

    def pointers_in_ram(self, pc: int) -> bool:
        """Whether all pointers that the code at an address loads point into RAM."""
        return bool(self._ram) and self.sources.line_of(pc)[0] in self._ram

    def call_targets(self, pc: int, state: AbstractState) -> list[int] | None:
        """Return the targets of a call through a pointer, by CALL_TARGETS or the annotation file; None if unknown."""
        found: set[int] = set()
        for annotation in self.bindings.call_target_annotations(pc):
            for name in (part.strip() for part in annotation.text.split(",")):
                if name.startswith("-"):
                    found.discard(self.address(name[1:].strip(), annotation) or 0)
                elif name in self.signatures.types:
                    wanted = self.signatures.types[name]
                    found |= {a for a in self._address_taken() if self.signatures.functions.get(a) == wanted}
                else:
                    address = self.address(name, annotation)
                    if address is None:
                        raise ToolError(f"{annotation.place}: {name} is neither a function nor a function type")
                    found.add(address)
            return sorted(found)
        owner = self.calls.name(pc).partition("+")[0]
        names = self.calls.annotations.calls
        listed = names.get(owner) or names.get(owner.removeprefix("_"))
        return [self.calls._named(name) for name in listed] if listed else None

    def threads(self) -> list[int]:
        """Return the entry functions of threads: those of a type that THREADS names, or of the annotation file."""
        found = {self.calls._named(name) for name in self.calls.annotations.threads}
        for annotation in self.annotations.of("threads"):
            for name in annotation.text.split(","):
                wanted = self.signatures.types.get(name.strip())
                found |= {
                    a
                    for a in self._address_taken()
                    if wanted is not None and self.signatures.functions.get(a) == wanted
                }
        return sorted(found)

    def interrupts(self) -> list[tuple[int, str, int]]:
        """Return handler, name and level of every interrupt and trap with a handler, once per vector.

        The level of an interrupt is that of INTERRUPT_LEVEL or of a symbol `os_level_of_NAME`, else its reset value;
        traps have levels above 7.
        """
        traps = {vector.name: vector.level for vector in self.chip.vectors if vector.irq is None}
        levels = self._annotated_levels()
        found: dict[tuple[int, str], int] = {}
        for handler, vectors in self.calls.vectors.items():
            name = self.calls.name(handler)
            if name == UNUSED:
                continue
            plain = list(dict.fromkeys(vector.removeprefix("Alt") for vector in vectors.split()))
            for vector in plain:
                level = traps.get(vector, levels.get(vector.removesuffix("Interrupt"), RESET_LEVEL))
                found[handler, name if len(plain) == 1 else "__" + vector] = level
        return [(handler, name, level) for (handler, name), level in found.items()]

    def priorities(self) -> dict[int, list[tuple[int, str, int]]]:
        """Return, by priority register, shift, name and annotated level of each interrupt with a handler."""
        levels = self._annotated_levels()
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
                field = shift, source, levels.get(source, RESET_LEVEL)
                found.setdefault(self.chip.sfrs[register].address, []).append(field)
        return found

    def enable_registers(self) -> frozenset[int]:
        """Return the addresses of interrupt enable registers."""
        return frozenset(self.chip.sfrs[source.enable[0]].address for source in self.chip.interrupts.values())

    def _annotated_levels(self) -> dict[str, int]:
        """Return the annotated levels by interrupt name."""
        levels: dict[str, int] = {}
        for annotation in self.annotations.of("level"):
            name, _, text = annotation.text.partition(" ")
            number = self.annotations.number(text, annotation)
            if number is not None:
                levels[name] = number
        for symbol in self.image.symbols:
            if symbol.name.startswith("os_level_of_"):
                levels[symbol.name.removeprefix("os_level_of_")] = symbol.value
        return levels

    def handlers_outside_sections(self) -> set[int]:
        """Return the handlers that OUTSIDE_ONLY names."""
        names = {
            name.strip() + "Interrupt"
            for annotation in self.annotations.of("outside")
            for name in annotation.text.split(",")
        }
        return {handler for handler, found in self.calls.vectors.items() if names & set(found.split())}

    def excluded(self) -> frozenset[int]:
        """Return the entries of the excluded functions; raises `ToolError` for an unknown name."""
        found = set()
        for name in self.excluded_names:
            address = self.address(name)
            if address not in self.calls.entries:
                raise ToolError(f"no function is called {name}")
            found.add(address)
        return frozenset(found)

    def _address_taken(self) -> set[int]:
        """Return the functions whose address is taken."""
        return self.calls.handles

    def return_level(self, entry: int) -> int | None:
        """Return the CPU priority at which a stack-switching function returns, by COMES_BACK."""
        for annotation in self.annotations.of("back"):
            name, _, level = annotation.text.partition(" ")
            if self.address(name, annotation) == entry:
                return self.annotations.number(level, annotation)
        return None

    def switches_stack(self, entry: int) -> bool:
        """Whether a function may switch stacks: it is not longjmp, and the image has stack-switch annotations."""
        annotated = any(self.annotations.of(kind) for kind in ("stack", "back", "resumed"))
        return annotated and entry != self.address("_longjmp")

    def resume_points(self) -> list[int]:
        """Return the functions that RESUMED_BY names."""
        said = [
            (name.strip(), annotation)
            for annotation in self.annotations.of("resumed")
            for name in annotation.text.split(",")
        ]
        return [a for name, annotation in said if (a := self.address(name, annotation)) is not None]

    def recursion_depth(self, entry: int) -> int | None:
        """Return the greatest number of simultaneous activations of a function, by annotation."""
        return self.calls.annotation(self.calls.annotations.recursion, entry)
