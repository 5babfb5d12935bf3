"""Running a machine aside: as if nobody watched, and put back as it was; and the way it came, run again.

What enters: a machine, a state to begin with, a cycle to get to. What leaves: the branches on the way. The state is one
record and equal records run equally (emu/README.md), so nothing has to be written down while the firmware runs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.state.state import STACK_POINTER

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

BRANCHES: Final = 20
"""Branches that are told."""
WINDOWS: Final = (4_000, 64_000, 400_000)
"""Cycles before the end that are stepped, in turn, until there are enough branches."""


@dataclass(frozen=True, slots=True)
class Branch:
    """The program went from the instruction at `source`, begun in `cycle`, to `target` instead of on."""

    source: int
    target: int
    cycle: int
    kind: str
    """"branch" or "exception"."""


@dataclass(frozen=True, slots=True)
class Trail:
    """How a machine came to where it stands."""

    branches: tuple[Branch, ...]
    """The last ones, oldest first."""
    last: int | None
    """The instruction that ran last, ..."""
    cycle: int
    """... the cycle it began in, ..."""
    top: int
    """... W15 behind it, ..."""
    access: tuple[int, int, bool] | None
    """... and its data access that was an address error: address, bytes, whether it was a write."""


@contextmanager
def aside(machine: Machine, state: bytes | None = None) -> Iterator[None]:
    """Inside the block the machine may be run and changed, from `state` if given: nobody is told, no hook is called.
    Afterwards it is as before, to the bit."""
    kept = machine.record.snapshot()
    held = machine.hold()
    quiet, machine.events.quiet = machine.events.quiet, True
    try:
        if state is not None:
            machine.put_back(state)
        yield
    finally:
        machine.put_back(kept)
        machine.events.quiet = quiet
        held()


def trail(machine: Machine, state: bytes, end: int, until: Callable[[], bool] | None = None) -> Trail | None:
    """The way from `state` to the first instruction boundary at which `until` holds, or without `until` to where the
    machine stops; in both cases by cycle `end`.

    None if the machine, run again, does not get there: then something came from outside that the state does not know.
    """
    for window in WINDOWS:
        with aside(machine, state):
            start = machine.cycle
            if machine.run_until(max(start, end - window)) is not None:
                return None
            found = _stepped(machine, end, until)
        if found is None or len(found.branches) >= BRANCHES or end - window <= start:
            return found
    return found


def _stepped(machine: Machine, end: int, until: Callable[[], bool] | None) -> Trail | None:
    branches: deque[Branch] = deque(maxlen=BRANCHES)
    stop: Stop | None = None
    last: int | None = None
    began = machine.cycle
    with _errors(machine) as errors:
        while machine.cycle <= end and not (until is not None and until()):
            before = machine.pc
            stop = machine.approach(end + 1)
            if stop is not None or machine.cycle > end:
                break
            if machine.pc != before and last is not None:
                branches.append(Branch(before, machine.pc, machine.cycle, "exception"))
            began, pc = machine.cycle, machine.pc
            errors.clear()
            stop = machine.step()
            last = pc
            if stop is not None:
                break
            if machine.pc not in _next(machine, pc):
                branches.append(Branch(pc, machine.pc, began, "branch"))
    if stop is None if until is None else not until():
        return None
    top = machine.w[STACK_POINTER]
    return Trail(tuple(branches), last, began, top, errors[0] if errors else None)


@contextmanager
def _errors(machine: Machine) -> Iterator[list[tuple[int, int, bool]]]:
    """A list that gets every data access that is an address error, while the machine is stepped."""
    data, builder = machine.core.data, machine.core.builder
    found: list[tuple[int, int, bool]] = []
    faulty, commit = data.faulty, builder.commit
    storing = False

    def noted(ea: int, size: int) -> bool:
        bad = faulty(ea, size)
        if bad:
            found.append((ea, size, storing))
        return bad

    def committed() -> None:
        nonlocal storing
        storing = True
        try:
            commit()
        finally:
            storing = False

    vars(data)["faulty"], vars(builder)["commit"] = noted, committed
    try:
        yield found
    finally:
        del vars(data)["faulty"], vars(builder)["commit"]


def _next(machine: Machine, pc: int) -> tuple[int, ...]:
    """Where a program goes on without branching: behind the instruction, or at it again under REPEAT."""
    insn = decode_for_execution(machine.program.word(pc), machine.program.word(pc + 2))
    return (pc + 2 * (insn.words if insn is not None else 1), pc)
