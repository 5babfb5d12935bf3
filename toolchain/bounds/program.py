"""The analysed image: code, constants, symbols and annotations."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from typing import Final

from toolchain.bounds.abstract.state import AbstractState
from toolchain.bounds.abstract.values import WINDOW
from toolchain.bounds.annotations.bindings import AnnotationBindings
from toolchain.bounds.annotations.file import FileAnnotations, add_symbols
from toolchain.bounds.annotations.names import NameResolver
from toolchain.bounds.graph import GraphBuilder
from toolchain.elf.annotations import Annotation, read_annotation_section
from toolchain.elf.code_map import CodeMap
from toolchain.elf.disassemble import items
from toolchain.elf.model import Executable
from toolchain.elf.signatures import Signatures
from toolchain.elf.source_map import SourceMap
from toolchain.errors import ToolError
from toolchain.link.levels import RESET_LEVEL, levels_of

PAGE = 0x8000
UNUSED = "__DefaultInterrupt"
"""Default handler of unused vectors; it does not return."""
ANY = "*"
"""Target in an annotation file that stands for every function whose address is taken."""
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
        values: Mapping[str, int] | None = None,
        excluded_names: Iterable[str] = (),
        file: FileAnnotations | None = None,
    ) -> None:
        """Read the annotations of an image.

        values          values of names in the annotations
        excluded_names  functions whose callers' paths are ignored
        file            annotations of the annotation file

        Raises `ToolError` for an annotation that cannot be parsed or names an unknown function.
        """
        sys.setrecursionlimit(max(sys.getrecursionlimit(), PYTHON_DEPTH))
        self.image, self.excluded_names = image, excluded_names
        self.annotations = read_annotation_section(image, values or {})
        self.file: Final = file or FileAnnotations()
        add_symbols(self.file, image.symbols)
        self.calls: Final = CodeMap(image)
        self.chip: Final = self.calls.chip
        self.depths: Final = {self.calls.named(name): depth for name, depth in self.file.depth.items()}
        self.recursions: Final = {self.calls.named(name): count for name, count in self.file.recursion.items()}
        self._file_threads = {self.calls.named(name) for name in self.file.threads}
        self.graph: Final = GraphBuilder(self.calls.code, self.calls.entries | self._file_threads)
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
        self.recursions.update(self._recursion_bounds())
        self.bindings: Final = AnnotationBindings(self.annotations, self.sources, self.names, self.calls.code)
        self._ram = {
            file
            for annotation in self.annotations.of("ram")
            for file in self.sources.matching_files(_neighbour_file(annotation))
        }

    def _recursion_bounds(self) -> dict[int, int]:
        """Return the activations of functions, by RECURSION_BOUND; functions that are not linked have none."""
        found = {}
        for annotation in self.annotations.of("recursion"):
            name, _, text = annotation.text.partition(" ")
            address, count = self.address(name, annotation), self.annotations.number(text, annotation)
            if address is not None and count is not None:
                found[address] = count
        return found

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
        listed = [(annotation, annotation.text) for annotation in self.bindings.call_target_annotations(pc)]
        symbol = self.calls.symbol(pc)
        if not listed and symbol is not None:
            listed = self._targets_of(symbol[0].value)
        for annotation, text in listed:
            for name in (part.strip() for part in text.split(",")):
                if name.startswith("-"):
                    found.discard(self.address(name[1:].strip(), annotation) or 0)
                elif name in self.signatures.types:
                    found |= self._of_type(name)
                else:
                    address = self.address(name, annotation)
                    if address is None and self._is_not_linked(name, annotation):
                        continue
                    if address is None:
                        raise ToolError(f"{annotation.place}: {name} is neither a function nor a function type")
                    found.add(address)
        if listed:
            return sorted(found)
        owner = symbol[0].name if symbol is not None else ""
        names = self.file.calls.get(owner) or self.file.calls.get(owner.removeprefix("_")) or []
        if not names and self.file.any_handle:
            names = [ANY]
        taken = self.calls.handles
        return sorted({a for name in names for a in (taken if name == ANY else [self.calls.named(name)])}) or None

    def _is_not_linked(self, name: str, annotation: Annotation) -> bool:
        """Whether the linker dropped a target: the file of a TARGETS_OF, or a function without code of the own file."""
        file = self.sources.file_of(annotation)
        if file is None:
            return annotation.kind == "targets"
        return self.sources.declares(file, name) and (file, name) not in self.sources.functions.values()

    def _targets_of(self, caller: int) -> list[tuple[Annotation, str]]:
        """Return annotation and targets of each TARGETS_OF of a function or label."""
        found = []
        for annotation in self.annotations.of("targets"):
            name, _, text = annotation.text.partition(" ")
            if self.address(name, annotation) == caller:
                found.append((annotation, text))
        return found

    def _of_type(self, name: str) -> set[int]:
        """Return the functions of a function type whose address is taken, none for an unknown type."""
        wanted = self.signatures.types.get(name)
        return {a for a in self.calls.handles if wanted is not None and self.signatures.functions.get(a) == wanted}

    def threads(self) -> list[int]:
        """Return the entry functions of threads: those of a type that THREADS names, or of the annotation file."""
        found = set(self._file_threads)
        for annotation in self.annotations.of("threads"):
            for name in annotation.text.split(","):
                found |= self._of_type(name.strip())
        return sorted(found)

    def interrupts(self) -> list[tuple[int, str, int]]:
        """Return handler, name and level of every interrupt and trap with a handler, once per vector.

        The level of an interrupt is that of INTERRUPT_LEVEL or of a symbol `os_level_of_NAME`, else its reset value;
        traps have levels above 7.
        """
        traps = {vector.name: vector.level for vector in self.chip.vectors if vector.irq is None}
        levels = levels_of(self.image, self.annotations)
        found: dict[tuple[int, str], int] = {}
        for handler, vectors in self.calls.vectors.items():
            name = self.calls.name(handler)
            if name == UNUSED:
                continue
            for vector in vectors:
                level = traps.get(vector, levels.get(vector.removesuffix("Interrupt"), RESET_LEVEL))
                found[handler, name if len(vectors) == 1 else "__" + vector] = level
        return [(handler, name, level) for (handler, name), level in found.items()]

    def priorities(self) -> dict[int, list[tuple[int, str, int]]]:
        """Return, by priority register, shift, name and annotated level of each interrupt with a handler."""
        levels = levels_of(self.image, self.annotations)
        handled = {
            vector
            for handler, names in self.calls.vectors.items()
            if self.calls.name(handler) != UNUSED
            for vector in names
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

    def handlers_outside_sections(self) -> set[int]:
        """Return the handlers that OUTSIDE_ONLY names."""
        names = {
            name.strip() + "Interrupt"
            for annotation in self.annotations.of("outside")
            for name in annotation.text.split(",")
        }
        return {handler for handler, found in self.calls.vectors.items() if names & set(found)}

    def excluded(self) -> frozenset[int]:
        """Return the entries of the excluded functions; raises `ToolError` for an unknown name."""
        found = set()
        for name in self.excluded_names:
            address = self.address(name)
            if address not in self.calls.entries:
                raise ToolError(f"no function is called {name}")
            found.add(address)
        return frozenset(found)

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
