"""Which loop and which call each note is of: those of its line, and no other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from emu.dspic30f.isa.facts import flow_of
from emu.dspic30f.isa.flow import Call, Goto
from toolchain.bounds.annotations.names import Names
from toolchain.bounds.annotations.notes import Note, Notes
from toolchain.bounds.annotations.sources import Line, Sources
from toolchain.bounds.graph import Code, Loop, loops_in
from toolchain.elf.disassemble import Item
from toolchain.errors import ToolError

LOOPS = ("loop", "total", "share", "same", "one")
CALLS = ("often", "if")


class Bindings:
    """What notes of lines say: of loops (asked by function and loop) and of calls (asked by address and callee).

    Raises `ToolError` for a note that is of no code of its function, or of no call of the function it names.
    """

    def __init__(self, notes: Notes, sources: Sources, names: Names, code: dict[int, Item]) -> None:
        self.notes, self.sources, self.names, self.items = notes, sources, names, code
        self._lines: Final[dict[tuple[str, Line], list[Note]]] = {}
        for kind in (*LOOPS, "calls"):
            for note in notes.of(kind):
                line = sources.target(note)
                if line is not None:
                    self._lines.setdefault((kind, line), []).append(note)
        self._loops: Final[dict[tuple[str, int], dict[int, set[Note]]]] = {}
        self._calls: Final[dict[str, dict[tuple[int, int], list[Note]]]] = {kind: {} for kind in CALLS}
        """By kind: place of a call and callee -> notes."""
        for kind in CALLS:
            for note in notes.of(kind):
                self._bind_call(kind, note)

    # -- loops -------------------------------------------------------------------------------------------------------

    def rounds(self, code: Code, loop: Loop) -> int | None:
        """Rounds of a loop by its LOOP_BOUND, the line in front of its condition."""
        numbers = self._numbers(code, loop, "loop")
        numbers += [self.notes.number(_words(note, 2)[1], note) for note in self._loops_of(code)]
        return None if None in numbers else max((n for n in numbers if n is not None), default=None)

    def total(self, code: Code, loop: Loop) -> int | None:
        """Rounds of a loop in all, by its LOOP_TOTAL."""
        numbers = self._numbers(code, loop, "total")
        return None if None in numbers else max((n for n in numbers if n is not None), default=None)

    def together(self, code: Code, loop: Loop) -> dict[int, tuple[str, int]]:
        """Rounds of a loop and all others of one LOOP_SHARE in one call of a function: what it says, the number."""
        notes = [note for head in loop.heads for note in self._bound(code, "share", head)]
        return {address: (text, number) for address, text, number in self._of_functions(notes)}

    def same(self, code: Code) -> set[int]:
        """Heads of loops that are one with the loop around them, by SAME_LOOP."""
        return {loop.head for loop in loops_in(code.order) if self._bound(code, "same", loop.head)}

    def one(self, code: Code, loop: Loop) -> bool:
        """Whether a loop of the machine code is one of the source: one way leads back, or ONE_LOOP says so.

        Ways that end in one line are copies of its condition; LOOPS_OF speaks of machine code.
        """
        if len(loop.heads) > 1 or self._bound(code, "one", loop.head) or self._loops_of(code):
            return True
        back = [head for head in loop.members if loop.head in code.blocks[head].following]
        lines = {self.sources.at(code.blocks[head].steps[-1].pc) for head in back}
        return len(back) == 1 or (len(lines) == 1 and ("", 0) not in lines)

    def scopes(self) -> frozenset[int]:
        """Functions that LOOP_SHARE and CALL_SHARE count rounds and calls in."""
        said = [(note.text.split()[0], note) for note in self.notes.of("share")]
        said += [(_words(note, 3)[1], note) for note in self.notes.of("often")]
        return frozenset(address for name, note in said if (address := self.names.find(name, note)) is not None)

    def _loops_of(self, code: Code) -> list[Note]:
        """LOOPS_OF that name a function."""
        return [note for note in self.notes.of("loops") if self.names.find(note.text.split()[0], note) == code.entry]

    def _numbers(self, code: Code, loop: Loop, kind: str) -> list[int | None]:
        return [self.notes.number(note.text, note) for head in loop.heads for note in self._bound(code, kind, head)]

    def _bound(self, code: Code, kind: str, head: int) -> set[Note]:
        if (kind, code.entry) not in self._loops:
            self._loops[kind, code.entry] = self._bind_loops(code, kind)
        return self._loops[kind, code.entry].get(head, set())

    def _bind_loops(self, code: Code, kind: str) -> dict[int, set[Note]]:
        """Notes by the head of their loop: the innermost one with code of their line, and no loop around that."""
        bound: dict[int, set[Note]] = {}
        for loop in reversed(loops_in(code.order)) if self.notes.of(kind) else ():
            inner = loops_in(loop.body)
            own = loop.members - {m for part in inner for m in part.members}
            below = {note for part in inner for note in bound[part.head]}
            lines = {self.sources.at(step.pc) for head in own for step in code.blocks[head].steps}
            found = {(line, note) for line in lines for note in self._lines.get((kind, line), ())}
            bound[loop.head] = {
                note for line, note in found if note not in below and (kind == "same" or self._is_of(code, loop, line))
            }
        return bound

    def _is_of(self, code: Code, loop: Loop, line: Line) -> bool:
        """Whether a line can be that of a loop: code of the same function within it stands on one side only, or a way
        out begins there. A loop that was unrolled leaves its line to the one around it, of which its notes say
        nothing."""
        first, end = self.sources.extent(line)
        places = [self.sources.at(step.pc) for head in loop.members for step in code.blocks[head].steps]
        around = [number for file, number in places if file == line[0] and first <= number < end]
        if min(around) >= line[1] or max(around) <= line[1]:
            return True
        leaving = [b for m in loop.members if not loop.members.issuperset((b := code.blocks[m]).following)]
        return any(self.sources.at(block.steps[-1].pc) == line for block in leaving)

    # -- calls -------------------------------------------------------------------------------------------------------

    def times(self, pc: int, target: int) -> dict[int, tuple[str, int]]:
        """By function, which call of the source the one there is, and how often it is made in one call of the function,
        by CALL_SHARE."""
        found = {}
        for note in self._calls["often"].get((pc, target), ()):
            for address, _, number in self._of_functions([note], skip=1):
                found[address] = f"{note.place} {note.text}", number
        return found

    def never(self, pc: int, target: int) -> bool:
        """Whether the call there is not made, by CALL_IF."""
        notes = self._calls["if"].get((pc, target), ())
        return any(self.notes.number(_words(note, 2)[1], note) == 0 for note in notes)

    def pointed(self, pc: int) -> list[Note]:
        """CALL_TARGETS in front of the call there."""
        return self._lines.get(("calls", self.sources.at(pc)), [])

    def _bind_call(self, kind: str, note: Note) -> None:
        line = self.sources.target(note)
        name = note.text.partition(" ")[0]
        callee = self.names.find(name, note)
        if line is None:
            return
        calls = list(self._calls_of(line))
        sites = [pc for pc, target in calls if callee is not None and target in (callee, None)]
        if not sites and (calls or callee is not None):
            raise ToolError(f"{note.place}: no call of {name} stands in line {line[1]}")
        for pc in sites:
            assert callee is not None
            self._calls[kind].setdefault((pc, callee), []).append(note)

    def _calls_of(self, line: Line) -> Iterator[tuple[int, int | None]]:
        """Calls of a line and what they call; None: through a pointer."""
        for start, end in self.sources.instructions(line):
            for pc in range(start, end, 2):
                item = self.items.get(pc)
                flow = flow_of(item.insn, pc) if item is not None and item.insn is not None else None
                match flow:
                    case Call(target):
                        yield pc, target if isinstance(target, int) else None
                    case Goto(target) if isinstance(target, int) and target in self.names.entries:
                        yield pc, target

    def _of_functions(self, notes: Iterable[Note], skip: int = 0) -> Iterator[tuple[int, str, int]]:
        """Function, rest and value of notes that have a function and a number behind `skip` other words."""
        for note in notes:
            name, text = _words(note, skip + 2)[skip:]
            address, number = self.names.find(name, note), self.notes.number(text, note)
            if address is not None and number is not None:
                yield address, text, number


def _words(note: Note, count: int) -> list[str]:
    """The text of a note as words, the last of them its rest; raises `ToolError` where there are less."""
    words = note.text.split(None, count - 1)
    if len(words) < count:
        raise ToolError(f"{note.place}: expected {count} arguments, got {note.text!r}")
    return words
