"""Model of the schedulers: each picks one of the ready threads, of which the first is next by round robin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.firmware.model.state import Thread
    from tests.firmware.model.threads import Threads


@dataclass(frozen=True)
class Scheduler:
    """eager: it also chooses within a slice, when a thread wakes or a message arrives."""

    pick: Callable[[Threads], Thread] | None
    eager: bool


def woken_first(kernel: Threads) -> Thread:
    """Return the first thread that was woken and has not been picked since."""
    for thread in kernel.ready:
        if thread.woken:
            thread.woken = False
            return thread
    return kernel.ready[0]


def highest_priority(kernel: Threads) -> Thread:
    """Return the first thread of the highest priority."""
    return max(kernel.ready, key=lambda thread: thread.priority)


def earliest_deadline(kernel: Threads) -> Thread:
    """Return the job on time with the earliest deadline. Late jobs are reported once and treated as aperiodic."""
    best, least = kernel.ready[0], 0x7FFF
    for thread in list(kernel.ready):
        if thread.period is not None and not thread.period.missed:
            left = thread.period.due - kernel.now
            if left < 0:
                kernel.report_miss(thread)
            elif left < least:
                best, least = thread, left
    return best


ROUND_ROBIN = Scheduler(None, False)
WOKEN_FIRST = Scheduler(woken_first, True)
FIXED_PRIORITY = Scheduler(highest_priority, True)
EARLIEST_DEADLINE = Scheduler(earliest_deadline, True)
