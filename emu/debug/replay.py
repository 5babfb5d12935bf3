"""Sandboxed runs of a machine, and the replay of a run from an earlier state.

Inputs: a machine, the snapshot from which to start, a last cycle. Output: the branches of the replayed run. A machine's
state is one record, and equal records run identically (docs/reference/engines.md), so a replay needs no log.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.state.state import STACK_POINTER
from emu.machine.fault import TakenBranch

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

MAX_BRANCHES: Final = 20
"""Maximum number of branches in a trace."""
WINDOWS: Final = (4_000, 64_000, 400_000)
"""Lengths in cycles of the single-stepped end of a replay. They are tried in turn until one has enough branches."""


@dataclass(frozen=True, slots=True)
class ExecutionTrace:
    """Last part of a run: how the machine reached its state."""

    branches: tuple[TakenBranch, ...]
    """The last branches, oldest first."""
    last: int | None
    """Address of the last instruction executed."""
    cycle: int
    """First cycle of the last instruction executed."""
    stack_pointer: int
    """Value of W15 after that instruction."""
    bad_access: tuple[int, int, bool] | None
    """Data access by which that instruction caused an address error: address, bytes, whether it is a write."""


@contextmanager
def sandboxed(machine: Machine, state: bytes | None = None) -> Iterator[None]:
    """Permit a block to run and change the machine, starting from the snapshot `state` if given.

    No observers or hooks are called. Afterwards the machine has its previous state, bit for bit.
    """
    before = machine.save_state()
    restore_host_state = machine.save_host_state()
    quiet, machine.events.quiet = machine.events.quiet, True
    try:
        if state is not None:
            machine.restore_state(state)
        yield
    finally:
        machine.restore_state(before)
        machine.events.quiet = quiet
        restore_host_state()


def retrace(machine: Machine, state: bytes, end: int, until: Callable[[], bool] | None = None) -> ExecutionTrace | None:
    """Replay from `state` to the first instruction boundary at which `until` holds; without `until`, to a stop.

    Return None if the replay has not got there by cycle `end`. In that case the original run received input that
    `state` does not contain.
    """
    for window in WINDOWS:
        with sandboxed(machine, state):
            start = machine.cycle
            if machine.run_until(max(start, end - window)) is not None:
                return None
            found = _single_step(machine, end, until)
        if found is None or len(found.branches) >= MAX_BRANCHES or end - window <= start:
            return found
    return found


def _single_step(machine: Machine, end: int, until: Callable[[], bool] | None) -> ExecutionTrace | None:
    """Single-step the machine and return the trace, with the end conditions of `retrace`."""
    branches: deque[TakenBranch] = deque(maxlen=MAX_BRANCHES)
    stop: Stop | None = None
    last: int | None = None
    began = machine.cycle
    with _address_errors(machine) as errors:
        while machine.cycle <= end and not (until is not None and until()):
            before = machine.pc
            stop = machine.service_boundary(end + 1)
            if stop is not None or machine.cycle > end:
                break
            if machine.pc != before and last is not None:
                branches.append(TakenBranch(before, machine.pc, machine.cycle, "exception"))
            began, pc = machine.cycle, machine.pc
            errors.clear()
            stop = machine.step()
            last = pc
            if stop is not None:
                break
            if machine.pc not in _sequential_targets(machine, pc):
                branches.append(TakenBranch(pc, machine.pc, began, "branch"))
    if stop is None if until is None else not until():
        return None
    return ExecutionTrace(tuple(branches), last, began, machine.w[STACK_POINTER], errors[0] if errors else None)


@contextmanager
def _address_errors(machine: Machine) -> Iterator[list[tuple[int, int, bool]]]:
    """Collect the data accesses that are address errors while the block single-steps the machine."""
    data, builder = machine.core.data, machine.core.builder
    found: list[tuple[int, int, bool]] = []
    faulty, commit = data.faulty, builder.commit
    storing = False

    def recorded(ea: int, size: int) -> bool:
        is_bad = faulty(ea, size)
        if is_bad:
            found.append((ea, size, storing))
        return is_bad

    def committing() -> None:
        nonlocal storing
        storing = True
        try:
            commit()
        finally:
            storing = False

    vars(data)["faulty"], vars(builder)["commit"] = recorded, committing
    try:
        yield found
    finally:
        del vars(data)["faulty"], vars(builder)["commit"]


def _sequential_targets(machine: Machine, pc: int) -> tuple[int, ...]:
    """Return the next addresses without a branch: the next instruction, or the same one under REPEAT."""
    insn = decode_for_execution(machine.program.word(pc), machine.program.word(pc + 2))
    return (pc + 2 * (insn.words if insn is not None else 1), pc)
