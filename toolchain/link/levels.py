"""CPU priorities of code: no interrupt may run code whose highest level (HIGHEST_LEVEL in bounds.h) is below its own.

In: a linked image with the annotations of bounds.h.  The check walks the call graph from every vector.  Copies of code
that the compiler has inlined are found by their source lines.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from emu.dspic30f.isa.facts import facts_of, flow_of
from emu.dspic30f.isa.flow import Branch, Call, Flow, Goto, Reset, Return, Skip
from emu.image.lines import LineTable
from toolchain.elf.annotations import AnnotationSet, read_annotation_section
from toolchain.elf.code_map import CodeMap
from toolchain.elf.model import Executable
from toolchain.elf.signatures import Signatures
from toolchain.elf.source_map import SourceMap
from toolchain.errors import ToolError

LEVEL_SYMBOL: Final = "os_level_of_"
"""Prefix of absolute symbols with the level of an interrupt (openswarm_interrupt.h)."""
RESET_LEVEL: Final = 4
"""Priority of every interrupt after a reset (isa.md §2.1)."""


def levels_of(image: Executable, annotations: AnnotationSet) -> dict[str, int]:
    """Return the levels by interrupt name, from INTERRUPT_LEVEL and the symbols of application interrupts."""
    found: dict[str, int] = {}
    for annotation in annotations.of("level"):
        name, _, text = annotation.text.partition(" ")
        number = annotations.number(text, annotation)
        if number is not None:
            found[name] = number
    for symbol in image.symbols:
        if symbol.name.startswith(LEVEL_SYMBOL):
            found[symbol.name.removeprefix(LEVEL_SYMBOL)] = symbol.value
    return found


def check_levels(image: Executable) -> None:
    """Raise `ToolError` with all violations of HIGHEST_LEVEL and RESERVED_LEVEL; images without them always pass."""
    annotations = read_annotation_section(image, {})
    if annotations.of("highest") or annotations.of("reserved"):
        findings = [f"error: {text}" for text in _Check(image, annotations).findings()]
        if findings:
            raise ToolError.of(findings)


@dataclass(frozen=True, slots=True)
class _Function:
    """One function without its callees: its instructions, calls, and calls through pointers."""

    addresses: list[int]
    callees: list[int]
    pointer_calls: list[int]


class _Check:
    def __init__(self, image: Executable, annotations: AnnotationSet) -> None:
        self.image, self.annotations = image, annotations
        self.map: Final = CodeMap(image)
        self.levels: Final = levels_of(image, annotations)
        self.limits: Final = [
            (int(level), f"/{folder.strip()}")
            for annotation in annotations.of("highest")
            for level, folders in [annotation.text.split(None, 1)]
            for folder in folders.split(",")
        ]
        """Highest level and path of a file or folder."""

    @cached_property
    def debug(self) -> dict[str, bytes]:
        return {s.name: bytes(s.data) for s in self.image.sections if s.name.startswith(".debug_")}

    @cached_property
    def lines(self) -> LineTable:
        return LineTable(self.debug)

    @cached_property
    def sources(self) -> SourceMap:
        return SourceMap(self.debug)

    @cached_property
    def signatures(self) -> Signatures:
        return Signatures(self.debug)

    def findings(self) -> Iterator[str]:
        """Yield the violations of all interrupts."""
        lowest = min((level for level, _ in self.limits), default=RESET_LEVEL)
        sources = {vector.name.removesuffix("Interrupt") for vector in self.map.chip.vectors if vector.irq is not None}
        for handler, vectors in self.map.vectors.items():
            for name in (vector.removesuffix("Interrupt") for vector in vectors):
                level = self.levels.get(name, RESET_LEVEL)
                if name in sources and (name in self.levels or len(vectors) == 1):
                    yield from self._reserved(name, level)
                    if level > lowest:
                        yield from self._intrusions(name, level, handler)

    def _reserved(self, name: str, level: int) -> Iterator[str]:
        for annotation in self.annotations.of("reserved"):
            reserved, names = annotation.text.split(None, 1)
            users = [user.strip() for user in names.split(",")]
            if level == int(reserved) and name not in users:
                yield f"{name}: level {level} belongs to {' and '.join(users)} ({annotation.place}); choose another one"

    def _intrusions(self, name: str, level: int, handler: int) -> Iterator[str]:
        """Yield each function that may not run at the level of an interrupt, with the shortest call chain."""
        first = self.lines.find(handler)
        own = first.file if first is not None else None
        chains = {handler: [name]}
        waiting = [handler]
        while waiting:
            entry = waiting.pop(0)
            function = self._function(entry)
            chain = " -> ".join(chains[entry])
            violation = self._violation(function.addresses, level, own)
            if violation is not None:
                yield f"{chain}: level {level} may not run {violation}; raise an interrupt of that level instead"
                continue
            targets = list(function.callees)
            for pc in function.pointer_calls:
                found = self._targets(pc, entry)
                if found is None:
                    yield (
                        f"{chain}: level {level} calls through a pointer ({self._place(pc)}), which may lead to code of"
                        " a lower level; state its targets (CALL_TARGETS, TARGETS_OF)"
                    )
                targets += found or []
            for target in targets:
                if target not in chains and target in self.map.code:
                    chains[target] = [*chains[entry], self.map.name(target).removeprefix("_")]
                    waiting.append(target)

    def _violation(self, addresses: list[int], level: int, own: str | None) -> str | None:
        """Return the first line with a highest level below `level`, and that level; None if there is none."""
        for address in addresses:
            line = self.lines.find(address)
            if line is not None and line.file != own:
                path = f"/{line.file}/"
                limit = min((most for most, part in self.limits if f"{part}/" in path), default=level)
                if limit < level:
                    return f"{line}, whose highest level is {limit}"
        return None

    def _place(self, pc: int) -> str:
        return str(self.lines.find(pc) or self.map.name(pc))

    def _function(self, entry: int) -> _Function:
        """Return the instructions and calls of the function at an address, in the order of addresses."""
        callees: set[int] = set()
        pointers: set[int] = set()
        seen: set[int] = set()
        work = [entry]
        while work:
            pc = work.pop()
            item = self.map.code.get(pc)
            if pc in seen or item is None or item.insn is None:
                continue
            seen.add(pc)
            after = pc + 2 * len(item.words)
            flow: Flow = flow_of(item.insn, pc) if facts_of(item.insn).flow is not None else None
            match flow:
                case Call(target):
                    callees |= {target} if isinstance(target, int) else set()
                    pointers |= set() if isinstance(target, int) else {pc}
                case Goto(target) if not isinstance(target, int):
                    if item.insn.row.mnemonic != "BRA":
                        pointers.add(pc)
                        continue
                case Goto(target):
                    if target in self.map.entries and target != entry:
                        callees.add(target)
                    else:
                        work.append(target)
                    continue
                case Branch(_, target):
                    work.append(target)
                case Skip():
                    skipped = self.map.code.get(after)
                    work.append(after + 2 * (len(skipped.words) if skipped else 1))
                case Return() | Reset():
                    continue
            work.append(after)
            if isinstance(flow, Goto):  # a computed jump into the table of BRA and RETLW after it
                work += self._table(after)
        return _Function(sorted(seen), sorted(callees), sorted(pointers))

    def _table(self, address: int) -> list[int]:
        found = []
        while (item := self.map.code.get(address)) is not None and item.insn is not None:
            if item.insn.row.mnemonic not in ("BRA", "RETLW", "RETURN"):
                break
            found.append(address)
            address += 2
        return found

    def _targets(self, pc: int, entry: int) -> list[int] | None:
        """Return the targets of an indirect call from the annotations of its line or function; None if unknown."""
        line = self.sources.line_of(pc)
        texts = [note.text for note in self.annotations.of("calls") if self.sources.target_line(note) == line]
        names = {self.map.name(pc).partition("+")[0], self.map.name(entry)}
        names |= {name.removeprefix("_") for name in names}
        for annotation in self.annotations.of("targets"):
            caller, _, text = annotation.text.partition(" ")
            texts += [text] if caller.rpartition("/")[2] in names else []
        words = [word.strip() for text in texts for word in text.split(",")]
        return [target for word in words for target in self._named(word)] if words else None

    def _named(self, word: str) -> list[int]:
        if word.startswith("-"):
            return []
        wanted = self.signatures.types.get(word)
        if wanted is not None:
            return [a for a in self.map.handles if self.signatures.functions.get(a) == wanted]
        return [self.map.named(word.rpartition("/")[2].strip())]
