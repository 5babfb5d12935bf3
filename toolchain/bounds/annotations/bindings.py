"""Binding of annotations to the loops and calls of their source line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from emu.dspic30f.isa.facts import flow_of
from emu.dspic30f.isa.flow import Call, Goto
from toolchain.bounds.annotations.names import NameResolver
from toolchain.bounds.graph import FunctionGraph, Loop, all_loops
from toolchain.elf.annotations import Annotation, AnnotationSet
from toolchain.elf.disassemble import CodeItem
from toolchain.elf.source_map import LineKey, SourceMap
from toolchain.errors import ToolError

LOOPS = ("loop", "total", "share", "same", "one")
CALLS = ("often", "if")


class AnnotationBindings:
    """Annotations of an image by the loops and calls to which they apply.

    Raises `ToolError` for an annotation after all code of its function, and for one whose line has no call of the
    function that it names.
    """

    def __init__(
        self, annotations: AnnotationSet, sources: SourceMap, names: NameResolver, code: dict[int, CodeItem]
    ) -> None:
        self.annotations, self.sources, self.names, self.items = annotations, sources, names, code
        self._lines: Final[dict[tuple[str, LineKey], list[Annotation]]] = {}
        for kind in (*LOOPS, "calls"):
            for annotation in annotations.of(kind):
                line = sources.target_line(annotation)
                if line is not None:
                    self._lines.setdefault((kind, line), []).append(annotation)
        self._loops: Final[dict[tuple[str, int], dict[int, set[Annotation]]]] = {}
        self._calls: Final[dict[str, dict[tuple[int, int], list[Annotation]]]] = {kind: {} for kind in CALLS}
        """By kind: (address of a call, callee) -> annotations."""
        for kind in CALLS:
            for annotation in annotations.of(kind):
                self._bind_call(kind, annotation)

    # -- loops -------------------------------------------------------------------------------------------------------

    def loop_bound(self, code: FunctionGraph, loop: Loop) -> int | None:
        """Return the iterations of a loop per entry, by its LOOP_BOUND or a LOOPS_OF."""
        numbers = self._numbers(code, loop, "loop")
        numbers += [
            self.annotations.number(_words(annotation, 2)[1], annotation)
            for annotation in self._machine_loop_annotations(code, loop)
        ]
        return None if None in numbers else max((n for n in numbers if n is not None), default=None)

    def total_iterations(self, code: FunctionGraph, loop: Loop) -> int | None:
        """Return the iterations of a loop over all its entries, by its LOOP_TOTAL."""
        numbers = self._numbers(code, loop, "total")
        return None if None in numbers else max((n for n in numbers if n is not None), default=None)

    def shared_iterations(self, code: FunctionGraph, loop: Loop) -> dict[int, tuple[str, int]]:
        """Return the LOOP_SHAREs of a loop, by function: text, and iterations shared in one call of the function."""
        annotations = [annotation for head in loop.heads for annotation in self._annotations_at(code, "share", head)]
        return {address: (text, number) for address, text, number in self._function_values(annotations)}

    def merged_loops(self, code: FunctionGraph) -> set[int]:
        """Return the heads of loops that SAME_LOOP merges with the enclosing loop."""
        return {loop.head for loop in all_loops(code.order) if self._annotations_at(code, "same", loop.head)}

    def is_single_loop(self, code: FunctionGraph, loop: Loop) -> bool:
        """Whether a loop of the machine code is a single loop of the source: it has one back edge, or ONE_LOOP is set.

        Back edges in one source line are copies of its condition.  LOOPS_OF refers to loops of the machine code.
        """
        if len(loop.heads) > 1 or self._annotations_at(code, "one", loop.head):
            return True
        if self._machine_loop_annotations(code, loop):
            return True
        back = [head for head in loop.members if loop.head in code.blocks[head].following]
        lines = {self.sources.line_of(code.blocks[head].steps[-1].pc) for head in back}
        return len(back) == 1 or (len(lines) == 1 and ("", 0) not in lines)

    def sharing_scopes(self) -> frozenset[int]:
        """Return the functions whose calls LOOP_SHARE and CALL_SHARE refer to."""
        named = [(annotation.text.split()[0], annotation) for annotation in self.annotations.of("share")]
        named += [(_words(annotation, 3)[1], annotation) for annotation in self.annotations.of("often")]
        return frozenset(
            address for name, annotation in named if (address := self.names.find(name, annotation)) is not None
        )

    def _machine_loop_annotations(self, code: FunctionGraph, loop: Loop) -> list[Annotation]:
        """Return the LOOPS_OF annotations that name the function, or a label at the head of the loop."""
        return [
            annotation
            for annotation in self.annotations.of("loops")
            if self.names.find(annotation.text.split()[0], annotation) in (code.entry, *loop.heads)
        ]

    def _numbers(self, code: FunctionGraph, loop: Loop, kind: str) -> list[int | None]:
        return [
            self.annotations.number(annotation.text, annotation)
            for head in loop.heads
            for annotation in self._annotations_at(code, kind, head)
        ]

    def _annotations_at(self, code: FunctionGraph, kind: str, head: int) -> set[Annotation]:
        if (kind, code.entry) not in self._loops:
            self._loops[kind, code.entry] = self._bind_loops(code, kind)
        return self._loops[kind, code.entry].get(head, set())

    def _bind_loops(self, code: FunctionGraph, kind: str) -> dict[int, set[Annotation]]:
        """Return annotations by loop head; an annotation belongs to the innermost loop with code of its line."""
        bound: dict[int, set[Annotation]] = {}
        for loop in reversed(all_loops(code.order)) if self.annotations.of(kind) else ():
            inner = all_loops(loop.body)
            own = loop.members - {m for part in inner for m in part.members}
            below = {annotation for part in inner for annotation in bound[part.head]}
            lines = {self.sources.line_of(step.pc) for head in own for step in code.blocks[head].steps}
            found = {(line, annotation) for line in lines for annotation in self._lines.get((kind, line), ())}
            bound[loop.head] = {
                annotation
                for line, annotation in found
                if annotation not in below and (kind == "same" or self._is_loop_line(code, loop, line))
            }
        return bound

    def _is_loop_line(self, code: FunctionGraph, loop: Loop, line: LineKey) -> bool:
        """Whether a line can be the line of a loop.

        All code of the function within the loop must be on one side of the line, or an exit of the loop must be in the
        line.  The line of an unrolled loop is part of the enclosing loop, to which its annotations do not apply.
        """
        first, end = self.sources.function_extent(line)
        places = [self.sources.line_of(step.pc) for head in loop.members for step in code.blocks[head].steps]
        around = [number for file, number in places if file == line[0] and first <= number < end]
        if min(around) >= line[1] or max(around) <= line[1]:
            return True
        leaving = [b for m in loop.members if not loop.members.issuperset((b := code.blocks[m]).following)]
        return any(self.sources.line_of(block.steps[-1].pc) == line for block in leaving)

    # -- calls -------------------------------------------------------------------------------------------------------

    def call_counts(self, pc: int, target: int) -> dict[int, tuple[str, int]]:
        """Return the CALL_SHAREs of a call, by function: source call, and its number per call of the function."""
        found = {}
        for annotation in self._calls["often"].get((pc, target), ()):
            for address, _, number in self._function_values([annotation], skip=1):
                found[address] = f"{annotation.place} {annotation.text}", number
        return found

    def is_never_called(self, pc: int, target: int) -> bool:
        """Whether a CALL_IF with limit 0 excludes the call."""
        annotations = self._calls["if"].get((pc, target), ())
        return any(self.annotations.number(_words(annotation, 2)[1], annotation) == 0 for annotation in annotations)

    def call_target_annotations(self, pc: int) -> list[Annotation]:
        """Return the CALL_TARGETS annotations of the call at an address."""
        return self._lines.get(("calls", self.sources.line_of(pc)), [])

    def _bind_call(self, kind: str, annotation: Annotation) -> None:
        line = self.sources.target_line(annotation)
        name = annotation.text.partition(" ")[0]
        callee = self.names.find(name, annotation)
        if line is None:
            return
        calls = list(self._calls_of(line))
        sites = [pc for pc, target in calls if callee is not None and target in (callee, None)]
        if not sites and (calls or callee is not None):
            raise ToolError(f"{annotation.place}: line {line[1]} contains no call of {name}")
        for pc in sites:
            assert callee is not None
            self._calls[kind].setdefault((pc, callee), []).append(annotation)

    def _calls_of(self, line: LineKey) -> Iterator[tuple[int, int | None]]:
        """Yield the calls in a line: address and callee, None for a call through a pointer."""
        for start, end in self.sources.address_ranges(line):
            for pc in range(start, end, 2):
                item = self.items.get(pc)
                flow = flow_of(item.insn, pc) if item is not None and item.insn is not None else None
                match flow:
                    case Call(target):
                        yield pc, target if isinstance(target, int) else None
                    case Goto(target) if isinstance(target, int) and target in self.names.entries:
                        yield pc, target

    def _function_values(self, annotations: Iterable[Annotation], skip: int = 0) -> Iterator[tuple[int, str, int]]:
        """Yield function, text and number of annotations that have a function and a number after `skip` other words."""
        for annotation in annotations:
            name, text = _words(annotation, skip + 2)[skip:]
            address, number = self.names.find(name, annotation), self.annotations.number(text, annotation)
            if address is not None and number is not None:
                yield address, text, number


def _words(annotation: Annotation, count: int) -> list[str]:
    """Split the text of an annotation into `count` words, the last with the rest; raises `ToolError` for fewer."""
    words = annotation.text.split(None, count - 1)
    if len(words) < count:
        raise ToolError(f"{annotation.place}: expected {count} arguments, got {annotation.text!r}")
    return words
