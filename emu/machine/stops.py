"""Reasons for which a run ended, and the checkpoints that a run keeps for fault diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

from emu.chips.chip import Vector
from emu.machine.fault import FaultReport

REASONS: Final = ("limit", "breakpoint", "halt", "fault", "until", "interrupted")
CHECKPOINT_CYCLES: Final = 1 << 23
"""Maximum interval between two checkpoints of a run, in Tcy (half a second of an e-puck)."""
SLEEP_CYCLES: Final = 1 << 24
"""Maximum length of a sleep within one step that has no limit, in Tcy (1.1 s of an e-puck)."""
STILL_ASLEEP: Final = "the CPU still sleeps: no enabled interrupt has woken it"
"""Detail of the stop of a step in Idle or Sleep mode that reached its limit before an interrupt."""
CHANGED: Final = "a watched byte has changed"
"""Detail of the stop of a debugged Kilobot at its watched range."""
RESETS_KEPT: Final = 16
"""Capacity of `Machine.resets`."""
RESET_LOOP: Final = 8
"""Number of consecutive equal resets that is a fault; each is within RESET_LOOP_CYCLES of the previous one."""
RESET_LOOP_CYCLES: Final = 1_000_000


class LastReset(NamedTuple):
    """The last reset: cause, PC of its origin, cycle, and number of consecutive equal resets."""

    cause: str = ""
    origin: int = 0
    cycle: int = 0
    repeats: int = 0
    """Number of equal resets modulo RESET_LOOP; 0 marks a reset loop."""


def next_reset(last: LastReset, cause: str, origin: int, cycle: int) -> LastReset:
    """Return the record of a new reset. It repeats `last` if both are equal and close in time."""
    repeated = (last.cause, last.origin) == (cause, origin) and cycle - last.cycle < RESET_LOOP_CYCLES
    return LastReset(cause, origin, cycle, (last.repeats + 1 if repeated else 1) % RESET_LOOP)


@dataclass(slots=True)
class RunCheckpoints:
    """Snapshots of the record taken during a run, from which fault diagnosis replays the run."""

    start: bytes | None = None
    """An earlier state. Since then the machine has received no input."""
    recent: tuple[int, bytes] | None = None
    """Cycle and state of a later checkpoint. It becomes `start` when it is older than CHECKPOINT_CYCLES."""
    end: bytes | None = None
    """State at the end of the last `advance`. If a run begins with another state, the machine has received input."""
    trap: tuple[Vector, bytes, bytes | None] | None = None
    """The last trap: its vector, the state just before it, and the value of `start` at that time."""
    reset: bytes | None = None
    """State just before the fault reset that ended the run."""

    def take(self, cycle: int, state: bytes) -> None:
        """Take a checkpoint: a run continues from `state` at `cycle`."""
        if state != self.end:
            self.start, self.recent = state, (cycle, state)
        elif self.recent is None or cycle - self.recent[0] >= CHECKPOINT_CYCLES:
            self.start, self.recent = self.recent[1] if self.recent else state, (cycle, state)


@dataclass(frozen=True, slots=True)
class Stop:
    """Reason and place at which a run ended. `pc` is the next instruction, or the debugger word that ended the run."""

    reason: str
    """Reason, one of REASONS:

    - "limit": the limit of cycles or time was reached;
    - "breakpoint": a hook or a debugger word ended the run;
    - "halt": the CPU sleeps and no event can wake it;
    - "fault": the firmware failed;
    - "until": the requested place or condition was reached;
    - "interrupted": the caller interrupted the run.
    """
    pc: int
    cycle: int
    detail: str = ""
    """Cause of a fault, or text of a debugger word."""
    fault: FaultReport | None = None
    """Diagnosis of a fault (`emu.debug.fault_report`), if one is attached to the machine and an image is loaded."""
