"""Writes to the bytes of data breakpoints, logged by native code while the machine runs.

Input: a machine and its data breakpoints. Output: a list of writes. Each write ends the run right after the
instruction that makes it. A breakpoint that also observes reads, or a register, needs single steps instead.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from emu.dap.breakpoints import Breakpoint
from emu.dspic30f.change_log import BOUNDARY, Change, Entries, WatchedNumber, changes_in
from emu.instruments.changes import is_in_ram, log_changes

if TYPE_CHECKING:
    from emu.machine.machine import Machine


def can_log_writes(machine: Machine, breakpoints: Sequence[Breakpoint]) -> bool:
    """Whether native code can log what these data breakpoints observe."""
    return all(one.access == "write" and is_in_ram(machine, one.addresses[0], one.size) for one in breakpoints)


@contextmanager
def logged_writes(machine: Machine, breakpoints: Sequence[Breakpoint]) -> Iterator[list[Change]]:
    """Log the writes inside the block to the list. `Change.number` is the index of the breakpoint.

    Raises ValueError if another instrument runs.
    """
    writes: list[Change] = []

    def add(found: Entries) -> None:
        writes.extend(changes_in(found))
        machine.interrupt()

    watched = [WatchedNumber(one.addresses[0], one.size) for one in breakpoints]
    end = log_changes(machine, watched, add, (), every_write=True)
    try:
        yield writes
    finally:
        end()


def site_of(write: Change) -> int:
    """Return the program address of the instruction that made a write; for an interrupt entry, that of the handler."""
    return write.pc if write.site == BOUNDARY else write.site
