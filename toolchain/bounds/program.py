"""One image, ready to be explored: its code, constants and annotations."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import Final

from emu.chips import chip_named, chip_of
from emu.elffacts import PROCESSOR_MASK
from emu.lines import Lines
from toolchain.bounds.graph import Builder, Code, Loop, loops_in
from toolchain.bounds.notes import Note, Notes
from toolchain.bounds.signatures import Signatures
from toolchain.bounds.state import State
from toolchain.bounds.values import WINDOW
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


def tail(file: str) -> str:
    """Folder and name: notes and debug information name the same file from different folders on."""
    return "/".join(file.replace("\\", "/").split("/")[-2:])


def _beside(file: str, name: str) -> str:
    """The file of that name in the same folder; without a name the file itself."""
    return file.rpartition("/")[0] + "/" + name if name else file


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
        self.lines: Final = Lines(debug)
        self.signatures: Final = Signatures(debug)
        self._ram = {_beside(tail(note.file), note.text[1:].strip()) for note in notes.of("ram")}
        self._at: dict[str, dict[tuple[str, int], list[Note]]] = {}
        for note in notes.all:
            table = self._at.setdefault(note.kind, {})
            for line in (note.line, note.line + 1):
                table.setdefault((tail(note.file), line), []).append(note)
        self._loops: dict[tuple[str, int], dict[int, set[Note]]] = {}

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
        line = self.lines.find(pc)
        return f"{line} ({self.calls.name(pc)})" if line else self.calls.name(pc)

    def line(self, pc: int) -> tuple[str, int]:
        """File and line of an address."""
        found = self.lines.find(pc)
        return (tail(found.file), found.line) if found else ("", 0)

    def address(self, name: str) -> int | None:
        """Value of a symbol in C or assembly spelling."""
        for symbol in self.image.symbols:
            if symbol.name in (name, "_" + name):
                return symbol.value
        sfr = self.chip.sfrs.get(name)
        return None if sfr is None else sfr.address

    def interesting(self, prefix: str) -> list[str]:
        """Functions of that prefix, else main."""
        entries = self.calls.entries
        found = {s.name for s in self.image.symbols if s.name.startswith(prefix) and s.value in entries}
        return sorted(found) or [name for name in ("_main",) if self.address(name) in entries]

    # -- what notes answer ---------------------------------------------------------------------------------------

    def links_in_ram(self, pc: int) -> bool:
        """Whether the code there finds only RAM behind pointers it loads."""
        return bool(self._ram) and self.line(pc)[0] in self._ram

    def rounds(self, code: Code, loop: Loop) -> int | None:
        """Rounds of a loop by its LOOP_BOUND, the line in front of its condition."""
        numbers = self._numbers(code, loop, "loop")
        for note in self.notes.of("loops"):
            name, _, text = note.text.partition(" ")
            if self.address(name) == code.entry:
                numbers.append(self.notes.number(text, note))
        return None if None in numbers else max((n for n in numbers if n is not None), default=None)

    def total(self, code: Code, loop: Loop) -> int | None:
        """Rounds of a loop in all, by its LOOP_TOTAL."""
        numbers = self._numbers(code, loop, "total")
        return None if None in numbers else max((n for n in numbers if n is not None), default=None)

    def together(self, code: Code, loop: Loop) -> dict[int, tuple[str, int]]:
        """Rounds of a loop and all others of one LOOP_SHARE in one call of a function: what it says, the number."""
        notes = [note for head in loop.heads for note in self._bound(code, "share", head)]
        return {address: (text, number) for address, text, number in self._of_functions(notes)}

    def times(self, pc: int) -> dict[int, int]:
        """By function, how often the call there is made in one call of it, by CALL_SHARE."""
        notes = self._at["often"].get(self.line(pc), ()) if "often" in self._at else ()
        return {address: number for address, _, number in self._of_functions(notes)}

    def _of_functions(self, notes: Iterable[Note]) -> Iterator[tuple[int, str, int]]:
        """Function, rest and value of notes that begin with a function."""
        for note in notes:
            name, _, text = note.text.partition(" ")
            address, number = self.address(name), self.notes.number(text, note)
            if address is not None and number is not None:
                yield address, text, number

    def never(self, pc: int) -> bool:
        """Whether the call there is not made, by CALL_IF."""
        notes = self._at["if"].get(self.line(pc), ()) if "if" in self._at else ()
        return any(self.notes.number(note.text, note) == 0 for note in notes)

    def scopes(self) -> frozenset[int]:
        """Functions that LOOP_SHARE and CALL_SHARE name."""
        names = {note.text.partition(" ")[0] for kind in ("share", "often") for note in self.notes.of(kind)}
        return frozenset(a for name in names if (a := self.address(name)) in self.calls.entries and a is not None)

    def _numbers(self, code: Code, loop: Loop, kind: str) -> list[int | None]:
        return [self.notes.number(note.text, note) for head in loop.heads for note in self._bound(code, kind, head)]

    def same(self, code: Code) -> set[int]:
        """Heads of loops that are one with the loop around them, by SAME_LOOP."""
        return {loop.head for loop in loops_in(code.order) if self._bound(code, "same", loop.head)}

    def _bound(self, code: Code, kind: str, head: int) -> set[Note]:
        if (kind, code.entry) not in self._loops:
            self._loops[kind, code.entry] = self._bind(code, kind)
        return self._loops[kind, code.entry].get(head, set())

    def _bind(self, code: Code, kind: str) -> dict[int, set[Note]]:
        """Notes by the head of their loop: the innermost one with code of their line, and no loop around that."""
        table = self._at.get(kind, {})
        bound: dict[int, set[Note]] = {}
        for loop in reversed(loops_in(code.order)) if table else ():
            inner = loops_in(loop.body)
            own = loop.members - {m for part in inner for m in part.members}
            below = {note for part in inner for note in bound[part.head]}
            lines = {self.line(step.pc) for head in own for step in code.blocks[head].steps}
            bound[loop.head] = {note for line in lines for note in table.get(line, ())} - below
        return bound

    def targets(self, pc: int, state: State) -> list[int] | None:
        """Where a call through a pointer can lead, by CALL_TARGETS in front of it or by an annotation file."""
        found: set[int] = set()
        for note in self._at.get("calls", {}).get(self.line(pc), ()):
            for name in (part.strip() for part in note.text.split(",")):
                if name.startswith("-"):
                    found.discard(self.address(name[1:].strip()) or 0)
                elif name in self.signatures.types:
                    wanted = self.signatures.types[name]
                    found |= {a for a in self._taken() if self.signatures.functions.get(a) == wanted}
                else:
                    address = self.address(name)
                    if address is None:
                        raise ToolError(f"{note.file}:{note.line}: {name} is neither a function nor a type of one")
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

    def interrupts(self) -> dict[int, int]:
        """Level by handler: of traps above 7, told by INTERRUPT_LEVEL or `os_level_of_`, else that after a reset."""
        told: dict[str, int] = {}
        for note in self.notes.of("level"):
            name, _, text = note.text.partition(" ")
            number = self.notes.number(text, note)
            if number is not None:
                told[name] = number
        for symbol in self.image.symbols:
            if symbol.name.startswith("os_level_of_"):
                told[symbol.name.removeprefix("os_level_of_")] = symbol.value
        traps = {vector.name: vector.level for vector in self.chip.vectors if vector.irq is None}
        found: dict[int, int] = {}
        for handler, names in self.calls.vectors.items():
            if self.calls.name(handler) == UNUSED:
                continue
            for name in names.split():
                plain = name.removeprefix("Alt")
                level = traps.get(plain, told.get(plain.removesuffix("Interrupt"), RESET_LEVEL))
                found[handler] = max(found.get(handler, 0), level)
        return found

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
            if self.address(name) == entry:
                return self.notes.number(level, note)
        return None

    def switches(self, entry: int) -> bool:
        """Whether code moves to stacks of others, by STACK_AREA, COMES_BACK or RESUMED_BY; longjmp does not."""
        told = any(self.notes.of(kind) for kind in ("stack", "back", "resumed"))
        return told and entry != self.address("_longjmp")

    def resumed(self) -> list[int]:
        """Functions of RESUMED_BY."""
        names = [name.strip() for note in self.notes.of("resumed") for name in note.text.split(",")]
        return [a for name in names if (a := self.address(name)) is not None]

    def recursion(self, entry: int) -> int | None:
        """Activations of a function that exist at once, by annotation."""
        return self.calls.annotation(self.calls.annotations.recursion, entry)
