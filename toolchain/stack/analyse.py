"""The call graph and its worst case: per function, and per entry that starts with a stack of its own."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolchain.elf import constants as c
from toolchain.elf.disassemble import NO_INSTRUCTIONS, Item, Names, items
from toolchain.elf.model import Bind, Executable
from toolchain.elf.symbols import is_named
from toolchain.errors import ToolError
from toolchain.link.memory import CHIP
from toolchain.stack.annotations import Annotations
from toolchain.stack.effects import CALL_BYTES, Flow, effect_of
from toolchain.stack.walk import Call, Function, Walker


@dataclass(slots=True)
class Usage:
    """Stack of one function: own frame, worst total in bytes, the path that reaches it, what is not known."""

    name: str
    entry: int
    frame: int
    total: int = 0
    path: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)


@dataclass(slots=True)
class Entry:
    """A start of execution: "reset", "interrupt", "thread" or "pointer" (never called directly)."""

    kind: str
    usage: Usage
    extra: int = 0  # bytes the hardware pushes first

    @property
    def total(self) -> int:
        return self.usage.total + self.extra


@dataclass(slots=True)
class Report:
    functions: list[Usage]
    entries: list[Entry]


class Analysis:
    """Facts of one image; `report()` is the result."""

    def __init__(self, image: Executable, annotations: Annotations) -> None:
        self.image, self.annotations = image, annotations
        self.code: dict[int, Item] = {}
        for section in image.sections:
            if section.is_code and section.name not in NO_INSTRUCTIONS and section.address in CHIP.program["program"]:
                self.code.update((item.address, item) for item in items(section))
        self.names = Names(image.symbols)
        self.vectors = self._vectors()
        self.entries = self._entries()
        self.functions = self._walk_all()
        self._usages: dict[int, Usage] = {}
        self._active: list[int] = []

    # -- entries -------------------------------------------------------------------------------------------------

    def _vectors(self) -> dict[int, str]:
        """Handler address -> vector names, from the vector tables of the image."""
        words: dict[int, int] = {}
        for section in self.image.sections:
            if section.is_code and section.address < CHIP.program["aivt"].end:
                words.update((item.address, item.words[0]) for item in items(section))
        found: dict[int, list[str]] = {}
        for vector in CHIP.vectors:
            for address, name in ((vector.ivt, vector.name), (vector.aivt, "Alt" + vector.name)):
                handler = words.get(address, 0)
                if handler in self.code and name.removeprefix("Alt") not in found.setdefault(handler, []):
                    found[handler].append(name)
        return {handler: " ".join(names) for handler, names in found.items() if names}

    def _entries(self) -> set[int]:
        """Function starts: FUNC symbols, call targets, vectors, the program's entry, annotated names."""
        found = {self.image.entry, *self.vectors}
        for symbol in self.image.symbols:
            if symbol.section is not None and symbol.section.is_code and is_named(symbol):
                typed = symbol.type == c.STT_FUNC or (symbol.type == c.STT_NOTYPE and symbol.bind is not Bind.LOCAL)
                if typed and symbol.value in self.code and self.code[symbol.value].insn is not None:
                    found.add(symbol.value)
        for item in self.code.values():
            if item.insn is not None and (effect := effect_of(item.insn, item.address)).flow is Flow.CALL:
                found.add(effect.target)
        return found & set(self.code)

    def _walk_all(self) -> dict[int, Function]:
        walker = Walker(self.code, self.entries)
        return {entry: walker.walk(entry) for entry in sorted(self.entries)}

    def name(self, address: int) -> str:
        """Name people know an address by."""
        found = self.names.find(address, "code")
        if found is None:
            return f"{address:#x}"
        symbol, distance = found
        return f"{symbol.name}+{distance:#x}" if distance else symbol.name

    def _named(self, name: str) -> int:
        """Address of a function named in C or assembly spelling; raises `ToolError`."""
        for symbol in self.image.symbols:
            if symbol.name in (name, "_" + name) and symbol.section is not None and symbol.section.is_code:
                return symbol.value
        raise ToolError(f"no function is called {name}")

    def _annotation(self, table: dict[str, int], entry: int) -> int | None:
        name = self.name(entry)
        return table.get(name, table.get(name.removeprefix("_")))

    # -- totals --------------------------------------------------------------------------------------------------

    def usage(self, entry: int) -> Usage:
        """Return the worst case of the function at `entry`, callees included."""
        known = self._usages.get(entry)
        if known is not None:
            return known
        function = self.functions.get(entry) or Function(entry, notes=[f"no code at {entry:#x}"])
        result = Usage(self.name(entry), entry, function.frame, function.frame, [self.name(entry)])
        bound = self._annotation(self.annotations.depth, entry)
        if bound is not None:
            result.total = bound
            self._usages[entry] = result
            return result
        result.unknown = [f"{result.name}: {note}" for note in function.notes]
        self._active.append(entry)
        for call in function.calls:
            self._add_call(result, call)
        self._active.pop()
        repeats = self._annotation(self.annotations.recursion, entry)
        if repeats is not None and repeats > 1:
            result.total += (repeats - 1) * (result.total + CALL_BYTES)
        if not self._active or not self._in_cycle(entry):
            self._usages[entry] = result
        return result

    def _in_cycle(self, entry: int) -> bool:
        """Whether `entry` can reach a function whose walk is still open: its total is then not final yet."""
        seen, work = {entry}, [entry]
        while work:
            for call in self.functions[work.pop()].calls:
                for target in self._targets(call):
                    if target in self._active:
                        return True
                    if target in self.functions and target not in seen:
                        seen.add(target)
                        work.append(target)
        return False

    def _targets(self, call: Call) -> list[int]:
        if call.target is not None:
            return [call.target] if call.target else []
        owner = self.name(call.address).partition("+")[0]
        names = self.annotations.calls.get(owner) or self.annotations.calls.get(owner.removeprefix("_")) or []
        return [self._named(name) for name in names]

    def _add_call(self, result: Usage, call: Call) -> None:
        base = call.depth + (0 if call.tail else CALL_BYTES)
        targets = self._targets(call)
        if call.target == 0:  # a weak function that is not linked, as crt0's __user_init
            result.total = max(result.total, base)
            return
        if not targets:
            result.unknown.append(f"{result.name}: call through a pointer at {call.address:#x}")
            result.total = max(result.total, base)
        for target in targets:
            if target in self._active:
                if self._annotation(self.annotations.recursion, target) is None:
                    result.unknown.append(f"{result.name}: recursion to {self.name(target)} at {call.address:#x}")
                continue
            callee = self.usage(target)
            result.unknown += [note for note in callee.unknown if note not in result.unknown]
            if base + callee.total > result.total:
                result.total = base + callee.total
                result.path = [self.name(result.entry), *callee.path]

    def report(self) -> Report:
        """Return all functions, and the entries: reset, interrupts, threads, and what is only reached by pointer."""
        called = {t for f in self.functions.values() for call in f.calls for t in self._targets(call)}
        threads = [self._named(name) for name in self.annotations.threads]
        entries = [Entry("reset", self.usage(self.image.entry))]
        for handler in sorted(self.vectors):
            entries.append(Entry("interrupt", self.usage(handler), CALL_BYTES))
        entries += [Entry("thread", self.usage(address)) for address in dict.fromkeys(threads)]
        listed = {entry.usage.entry for entry in entries}
        for address in sorted(self.entries - called - listed):
            entries.append(Entry("pointer", self.usage(address)))
        return Report([self.usage(entry) for entry in sorted(self.functions)], entries)


__all__ = ["Analysis", "Entry", "Report", "Usage"]
