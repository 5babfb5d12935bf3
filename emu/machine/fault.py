"""Report of a firmware fault as plain data: cause, place, thread, call stack and last branches.

    >>> import emu
    >>> machine = emu.load("firmware.elf")
    >>> machine.pc = machine.program_address("broken")
    >>> report = machine.run().fault                # a FaultReport
    >>> report.facts()["cause"]
    'address error trap: reading 2 bytes at 0x0801, an odd address, no handler'
    >>> report.frames[0].function, report.thread    # frames are of type StackEntry
    ('broken', None)
    >>> report.branches                             # of type TakenBranch
    ()

`FaultReport.report` returns all of it as text.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any, Final

MAX_FRAMES_SHOWN: Final = 12
"""Maximum number of call stack entries in the text of a report."""


@dataclass(frozen=True, slots=True)
class TakenBranch:
    """A taken branch or exception entry, by which control passed from the instruction at `source` to `target`."""

    source: int
    target: int
    cycle: int
    """First cycle of the instruction at `source`; for an exception, of its handler's first instruction."""
    kind: str
    """Kind of transfer: "branch" or "exception"."""


@dataclass(frozen=True, slots=True)
class StackEntry:
    """One entry of the report's call stack."""

    pc: int
    function: str
    line: str | None
    kind: str
    variables: tuple[tuple[str, str], ...] = ()
    """Names and values of parameters and locals; only for the innermost entries."""


@dataclass(frozen=True, slots=True)
class FaultReport:
    """Description of a firmware fault. `pc` is the faulty instruction, or the best estimate of it."""

    cause: str
    """What failed; ends with a comma where the sentence with the place needs one."""
    pc: int
    cycle: int
    where: str = ""
    """`pc` as text with function and source line."""
    symbol: str | None = None
    line: str | None = None
    thread: str | None = None
    """Running thread of an OpenSwarm firmware, as text `thread 1 (worker)`."""
    frames: tuple[StackEntry, ...] = ()
    """The call stack at `pc`, innermost first, through interrupts."""
    branches: tuple[TakenBranch, ...] = ()
    """The last branches before the fault, oldest first.

    Empty unless `run`, `advance` or the command line ran the machine.
    """
    branch_texts: tuple[str, ...] = ()

    @property
    def function(self) -> str | None:
        """Name of the function that contains `pc`, None outside the program."""
        return self.frames[0].function if self.frames else None

    def report(self) -> str:
        """Return the complete report as lines of text."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        yield f"firmware fault: {self.cause} at {self.where}" + (f" in {self.thread}" if self.thread else "")
        for number, frame in enumerate(self.frames[:MAX_FRAMES_SHOWN]):
            note = f"  <{frame.kind}>" if frame.kind != "call" else ""
            yield f"  #{number} {frame.function} at {frame.line or f'{frame.pc:#08x}'}{note}"
            for name, value in frame.variables:
                yield f"       {name} = {value}"
        if len(self.frames) > MAX_FRAMES_SHOWN:
            yield f"  ... and {len(self.frames) - MAX_FRAMES_SHOWN} more"
        if self.branches:
            yield "  last branches, newest first:"
        for _, same in groupby(
            zip(reversed(self.branches), reversed(self.branch_texts), strict=True),
            lambda one: (one[0].source, one[0].target),
        ):
            times = [text for _, text in same]
            yield f"    {times[0]}" + (f", {len(times)} times" if len(times) > 1 else "")

    def facts(self) -> dict[str, Any]:
        """Return the report as JSON-compatible data."""
        return {
            "cause": self.cause.rstrip(","),
            "pc": self.pc,
            "cycle": self.cycle,
            "symbol": self.symbol,
            "line": self.line,
            "thread": self.thread,
            "frames": [asdict(entry) | {"variables": dict(entry.variables)} for entry in self.frames],
            "branches": [
                {"from": one.source, "to": one.target, "cycle": one.cycle, "kind": one.kind, "text": text}
                for one, text in zip(self.branches, self.branch_texts, strict=True)
            ],
        }
