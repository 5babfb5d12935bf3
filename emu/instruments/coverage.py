"""Coverage from exact counts of executed instructions and taken branches.

Input: a machine. Outputs: `Counts`, and lcov and Cobertura reports made from them. Coverage refers to the code in the
image, optimised or not. Functions that the linker removed are not in the reports.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from xml.etree import ElementTree

from emu.debug.inspector import Inspector
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.facts import flow_of
from emu.dspic30f.isa.flow import Branch, Skip
from emu.host.sources import source_lines
from emu.image.model import Image

if TYPE_CHECKING:
    from emu.machine.machine import Machine

EXCLUDED: Final = re.compile(r"LCOV_EXCL_(LINE|START|STOP)")
"""Comments that exclude source lines from a report, as in lcov's own tools."""


@dataclass(slots=True)
class Counts:
    """Number of executions by program address, and how often each conditional branch or skip was taken."""

    executed: Counter[int] = field(default_factory=Counter)
    taken: Counter[int] = field(default_factory=Counter)

    def add(self, other: Counts) -> None:
        """Add the counts of another run of the same image."""
        self.executed.update(other.executed)
        self.taken.update(other.taken)

    def facts(self, image: Image) -> dict[str, Any]:
        """Return the counts as plain data together with the image's fingerprint."""
        return {
            "image": fingerprint(image),
            "executed": {str(pc): count for pc, count in sorted(self.executed.items())},
            "taken": {str(pc): count for pc, count in sorted(self.taken.items())},
        }

    @classmethod
    def of(cls, facts: Any, image: Image) -> Counts:
        """Create counts from data returned by `facts`. Raises ValueError for invalid data or another image."""
        if not isinstance(facts, dict) or not {"image", "executed", "taken"} <= facts.keys():
            raise ValueError("expected counts of an earlier run")
        if facts["image"] != fingerprint(image):
            raise ValueError("these are counts of another image")
        try:
            return cls(*(Counter({int(pc): int(n) for pc, n in facts[key].items()}) for key in ("executed", "taken")))
        except (TypeError, AttributeError, OverflowError):
            raise ValueError("expected counts of an earlier run") from None


def fingerprint(image: Image) -> str:
    """Return the SHA-256 of all program words and their addresses."""
    text = hashlib.sha256()
    for block in image.blocks:
        text.update(block.base.to_bytes(4, "little") + block.words.tobytes())
    return text.hexdigest()


def count_executions(machine: Machine, counts: Counts) -> Callable[[], None]:
    """Start to count the instructions that `machine` executes. Return a function that stops counting.

    `counts` is complete once that function has been called. Native code has its own counters; it is translated again.
    """
    stop_interpreted = _count_interpreted(machine, counts)
    if machine.engine == "plain":
        return stop_interpreted
    from emu.dspic30f.jit.counting import ExecutionCounting
    from emu.dspic30f.jit.engine import JitEngine

    engine, counting = machine.runner, ExecutionCounting(machine.core)
    assert isinstance(engine, JitEngine)
    stop_native = engine.start_counting(counting)

    def stop() -> None:
        stop_native()
        stop_interpreted()
        program = machine.program
        for numbers, counter in ((counting.executions, counts.executed), (counting.taken_branches, counts.taken)):
            for word in numbers.nonzero()[0].tolist():
                pc = 2 * word
                if counter is counts.executed or is_conditional(program.word(pc), program.word(pc + 2), pc):
                    counter[pc] += int(numbers[word])

    return stop


def _count_interpreted(machine: Machine, counts: Counts) -> Callable[[], None]:
    """Start to count the instructions that the sequencer executes. Return a function that stops counting."""
    sequencer, state = machine.core.sequencer, machine.state
    execute, executed, taken = sequencer.execute, counts.executed, counts.taken
    conditional: dict[int, int] = {}

    def counted() -> None:
        pc = state.pc
        if not machine.program.executable(pc):
            execute()
            return
        execute()
        executed[pc] += 1
        following = conditional.get(pc)
        if following is None:
            following = conditional[pc] = _following(machine, pc)
        if following and state.pc != following:
            taken[pc] += 1

    vars(sequencer)["execute"] = counted

    def stop() -> None:
        if vars(sequencer).get("execute") is counted:
            del vars(sequencer)["execute"]

    machine.program.changed.append(lambda _start, _end: conditional.clear())
    return stop


def _following(machine: Machine, pc: int) -> int:
    """Return the fall-through address of a conditional instruction; 0 for any other instruction."""
    program = machine.program
    insn = decode_for_execution(program.word(pc), program.word(pc + 2))
    return pc + 2 * insn.words if insn is not None and is_conditional(program.word(pc), program.word(pc + 2), pc) else 0


def is_conditional(word1: int, word2: int, pc: int) -> bool:
    """Whether an instruction is a conditional branch or a skip."""
    insn = decode_for_execution(word1, word2)
    flow = flow_of(insn, pc) if insn is not None else None
    return isinstance(flow, Skip) or (isinstance(flow, Branch) and not isinstance(flow.cond, int))


@dataclass(slots=True)
class FileCoverage:
    """Coverage of one source file: counts by line, branches by line, functions by name."""

    lines: dict[int, int] = field(default_factory=dict)
    branches: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    """(not taken, taken) counts of each conditional instruction of a line; (0, 0) if it never executed."""
    functions: dict[str, tuple[int, int]] = field(default_factory=dict)
    """(line, count) of each function."""


class CoverageReport:
    """Coverage by source file. `path_of` returns the path of a file in the line table, to read exclusion comments."""

    def __init__(self, inspector: Inspector, counts: Counts, path_of: Callable[[str], Path]) -> None:
        self.files: Final[dict[str, FileCoverage]] = {}
        self.instructions = self.instructions_run = self.outcomes = self.outcomes_seen = 0
        self._inspector: Final = inspector
        self._counts: Final = counts
        self._lines()
        self._branches()
        self._functions()
        for name, one in self.files.items():
            for line in excluded_lines(path_of(name)):
                one.lines.pop(line, None)
                one.branches.pop(line, None)

    def _file(self, name: str) -> FileCoverage:
        return self.files.setdefault(name, FileCoverage())

    def _lines(self) -> None:
        """Count lines.

        A line's count is the maximum over its address ranges in one copy, summed over inlined copies.
        """
        copies: dict[tuple[str, int], dict[object, int]] = defaultdict(dict)
        for row in self._inspector.image.lines.rows:
            if not row.line or not self._inspector.is_code(row.start):
                continue
            function = self._inspector.debug.function(row.start)
            chain = function.chain(row.start) if function is not None else []
            copy = next((id(scope) for scope in reversed(chain) if scope.kind != "block"), None)
            counts = copies[row.file, row.line]
            counts[copy] = max(counts.get(copy, 0), self._counts.executed[row.start])
        for (file, line), counts in copies.items():
            self._file(file).lines[line] = sum(counts.values())

    def _branches(self) -> None:
        image = self._inspector.image
        for block in image.blocks:
            if not block.is_code:
                continue
            pc = block.base
            while pc < block.end:
                word1, word2 = image.word(pc) or 0, image.word(pc + 2) or 0
                insn = decode_for_execution(word1, word2)
                self.instructions += insn is not None
                self.instructions_run += insn is not None and self._counts.executed[pc] > 0
                if is_conditional(word1, word2, pc):
                    taken = self._counts.taken[pc]
                    outcomes = (self._counts.executed[pc] - taken, taken)
                    self.outcomes += 2
                    self.outcomes_seen += sum(times > 0 for times in outcomes)
                    line = image.lines.find(pc)
                    if line is not None and line.line:
                        self._file(line.file).branches.setdefault(line.line, []).append(outcomes)
                pc += 2 * (insn.words if insn is not None else 1)

    def _functions(self) -> None:
        for one in self._inspector.debug.functions:
            if one.file and one.line and self._inspector.is_code(one.ranges[0][0]):
                self._file(one.file).functions[one.name] = (one.line, self._counts.executed[one.ranges[0][0]])

    def lcov(self, path_of: Callable[[str], Path]) -> Iterator[str]:
        """Yield the text lines of an lcov tracefile."""
        for name, one in sorted(self.files.items()):
            yield "TN:"
            yield f"SF:{path_of(name)}"
            for function, (line, _) in sorted(one.functions.items()):
                yield f"FN:{line},{function}"
            for function, (_, count) in sorted(one.functions.items()):
                yield f"FNDA:{count},{function}"
            yield f"FNF:{len(one.functions)}"
            yield f"FNH:{sum(count > 0 for _, count in one.functions.values())}"
            for line, branches in sorted(one.branches.items()):
                for block, outcomes in enumerate(branches):
                    for branch, times in enumerate(outcomes):
                        yield f"BRDA:{line},{block},{branch},{times if any(outcomes) else '-'}"
            counts = [times for pairs in one.branches.values() for pair in pairs for times in pair]
            yield f"BRF:{len(counts)}"
            yield f"BRH:{sum(times > 0 for times in counts)}"
            for line, count in sorted(one.lines.items()):
                yield f"DA:{line},{count}"
            yield f"LF:{len(one.lines)}"
            yield f"LH:{sum(count > 0 for count in one.lines.values())}"
            yield "end_of_record"

    def cobertura(self, path_of: Callable[[str], Path]) -> str:
        """Return a Cobertura document. Its timestamp is 0, so that equal runs give equal files."""
        found = sum(len(one.lines) for one in self.files.values())
        hit = sum(count > 0 for one in self.files.values() for count in one.lines.values())
        top = ElementTree.Element("coverage", {
            "line-rate": _rate(hit, found), "branch-rate": _rate(self.outcomes_seen, self.outcomes),
            "lines-covered": str(hit), "lines-valid": str(found), "branches-covered": str(self.outcomes_seen),
            "branches-valid": str(self.outcomes), "complexity": "0", "version": "emu", "timestamp": "0",
        })  # fmt: skip
        package = ElementTree.SubElement(ElementTree.SubElement(top, "packages"), "package", {
            "name": "firmware", "line-rate": _rate(hit, found),
            "branch-rate": _rate(self.outcomes_seen, self.outcomes), "complexity": "0",
        })  # fmt: skip
        classes = ElementTree.SubElement(package, "classes")
        for name, one in sorted(self.files.items()):
            hit = sum(count > 0 for count in one.lines.values())
            branches = [times for pairs in one.branches.values() for pair in pairs for times in pair]
            entry = ElementTree.SubElement(classes, "class", {
                "name": Path(name).name, "filename": str(path_of(name)), "line-rate": _rate(hit, len(one.lines)),
                "branch-rate": _rate(sum(times > 0 for times in branches), len(branches)), "complexity": "0",
            })  # fmt: skip
            ElementTree.SubElement(entry, "methods")
            lines = ElementTree.SubElement(entry, "lines")
            for line, count in sorted(one.lines.items()):
                outcomes = [times for pair in one.branches.get(line, ()) for times in pair]
                facts = {"number": str(line), "hits": str(count), "branch": "true" if outcomes else "false"}
                if outcomes:
                    seen = sum(times > 0 for times in outcomes)
                    facts["condition-coverage"] = f"{100 * seen // len(outcomes)}% ({seen}/{len(outcomes)})"
                ElementTree.SubElement(lines, "line", facts)
        ElementTree.indent(top)
        return '<?xml version="1.0" ?>\n' + ElementTree.tostring(top, encoding="unicode") + "\n"


def _rate(part: int, whole: int) -> str:
    return f"{part / whole if whole else 1:.6f}"


def excluded_lines(path: Path) -> set[int]:
    """Return the line numbers that comments in a source file exclude; none if the file cannot be read."""
    try:
        lines = source_lines(path)
    except OSError:
        return set()
    out: set[int] = set()
    inside = False
    for number, line in enumerate(lines, 1):
        marks = EXCLUDED.findall(line)
        inside = inside or "START" in marks
        if inside or "LINE" in marks:
            out.add(number)
        if "STOP" in marks:
            inside = False
    return out
