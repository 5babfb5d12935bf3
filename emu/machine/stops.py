"""Why a run ended, and what is kept while it goes on to explain that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

from emu.chips.chip import Vector

if TYPE_CHECKING:
    from emu.machine.fault_report import Fault

REASONS: Final = ("limit", "breakpoint", "halt", "fault", "until", "interrupted")
CHECKPOINT_CYCLES: Final = 1 << 23
"""A run remembers where it was at least this often, to be able to go back when something goes wrong (half a second)."""
RESETS_KEPT: Final = 16
"""Length of `Machine.resets`."""
RESET_LOOP: Final = 8
"""Equal resets in a row, each within RESET_LOOP_CYCLES of the last, that count as a fault."""
RESET_LOOP_CYCLES: Final = 1_000_000


class LastReset(NamedTuple):
    """The reset before: its cause, the PC it came from, its cycle, and how many equal ones in a row it ended."""

    cause: str = ""
    culprit: int = 0
    cycle: int = 0
    repeats: int = 0
    """0 instead of RESET_LOOP."""


def following(last: LastReset, cause: str, culprit: int, cycle: int) -> LastReset:
    """The device was reset again."""
    soon = (last.cause, last.culprit) == (cause, culprit) and cycle - last.cycle < RESET_LOOP_CYCLES
    return LastReset(cause, culprit, cycle, (last.repeats + 1 if soon else 1) % RESET_LOOP)


@dataclass(slots=True)
class Evidence:
    """What a fault is explained with: states of the record, kept as the run goes on."""

    began: bytes | None = None
    """A while ago; nothing has come from outside since."""
    middle: tuple[int, bytes] | None = None
    """Less long ago: cycle and state. It becomes `began` when that has grown old."""
    ended: bytes | None = None
    """Where `advance` ended; a machine that begins elsewhere has been changed from outside."""
    trap: tuple[Vector, bytes, bytes | None] | None = None
    """The trap entered last: its vector, the state just before, and what `began` was then."""
    reset: bytes | None = None
    """Just before the reset for a fault that ended the run."""

    def look(self, cycle: int, state: bytes) -> None:
        """A run is about to go on from `state`, that of `cycle`."""
        if state != self.ended:
            self.began, self.middle = state, (cycle, state)
        elif self.middle is None or cycle - self.middle[0] >= CHECKPOINT_CYCLES:
            self.began, self.middle = self.middle[1] if self.middle else state, (cycle, state)


@dataclass(frozen=True, slots=True)
class Stop:
    """Why and where a run ended. `pc` is the next instruction, of a debugger word that word."""

    reason: str
    """One of REASONS: "limit" (of cycles or time), "breakpoint" (a hook said stop, or a debugger word), "halt" (asleep,
    and nothing will ever wake it), "fault" (the firmware went wrong), "until", "interrupted"."""
    pc: int
    cycle: int
    detail: str = ""
    fault: Fault | None = None
    """With reason "fault" and an image loaded: what went wrong, where, in which thread, and how it came to that."""
