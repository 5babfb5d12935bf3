"""Results of a memory measurement: threads, events and heap of an application over its run."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from emu.host.result_tables import data_frame, html_table

if TYPE_CHECKING:
    from emu.machine.stops import Stop


@dataclass(slots=True)
class ThreadUse:
    """All threads of one entry function over the whole run; byte counts are the worst of them."""

    name: str
    """The entry function; `main` for the system thread."""
    pid: int
    """PID of the first of these threads; 0 for the system thread."""
    stack: int
    """Configured bytes; for `main` the RAM that the linker leaves to its stack."""
    used: int
    """High-water mark in bytes."""
    free: int
    """Bytes that were never written."""
    guard: int
    """Bytes between the stack limit and the control block."""
    control_block: int
    heap: int
    """Bytes of the whole heap block: stack, control block and timing of a periodic thread; 0 for `main`."""
    cleanups: int = 0
    """Largest number of cleanup nodes."""
    mutexes: int = 0
    """Largest number of mutexes owned at once."""
    started: int = 1
    """Number of threads that were started with this entry function."""
    line: str = ""
    """Source line that started the thread."""


@dataclass(slots=True)
class EventUse:
    """An event over the whole run."""

    name: str
    identifier: int
    subscriptions: int
    """Largest number of subscriptions, those of drivers included."""
    by_drivers: int
    peak_messages: int
    peak_bytes: int
    """Heap bytes of the messages that were queued at once, at most."""
    sent: int
    line: str = ""
    """Source line that registered the event, or that subscribed to it last."""
    sender: str = ""
    """Source line that queued the message at the peak."""


@dataclass(slots=True)
class HeapUse:
    """The heap in bytes."""

    capacity: int
    peak: int
    """Largest use at any instruction."""
    used: int
    """Use at the end of the run."""
    free: int
    largest_free: int
    """Largest free block at the end: a larger allocation fails."""
    free_blocks: int
    threads: int
    events: int
    subscriptions: int
    gates: int
    messages: int
    """Queued messages at the end, and those that threads have not cleared."""
    drivers: int
    """All other allocations at the end: transmit queues of UARTs, blocks of bus transfers."""
    drivers_peak: int
    fullest: dict[str, int] = field(default_factory=dict)
    """Use by kind when the allocations read in the run were largest."""

    @property
    def fragmentation(self) -> float:
        """Share of the free bytes that is not in the largest free block, 0 to 1."""
        return 1 - self.largest_free / self.free if self.free else 0.0


@dataclass(slots=True)
class ApplicationMemory:
    """Memory of an application.

    `most_threads` is the largest number of threads at once. `equation` holds the terms of the memory equation with the
    application's numbers.
    """

    seconds: float
    threads: list[ThreadUse]
    most_threads: int
    events: list[EventUse]
    heap: HeapUse
    kernel_stack: int
    kernel_stack_used: int
    equation: dict[str, Any]
    stop: Stop | None = None

    def __repr__(self) -> str:
        threads, heap = len(self.threads), self.heap
        return f"<memory in {self.seconds:g} s: {threads} threads, heap {heap.used:,} of {heap.capacity:,} bytes used>"

    def frame(self) -> Any:
        """Return one row per thread as a pandas DataFrame. Raises ModuleNotFoundError without pandas."""
        return data_frame([asdict(one) for one in self.threads])

    def _repr_html_(self) -> str:
        threads = html_table([asdict(one) for one in self.threads], repr(self)[1:-1])
        return threads + html_table([asdict(one) for one in self.events], "events")

    def facts(self) -> dict[str, Any]:
        """Return everything as plain data."""
        return {
            "seconds": self.seconds,
            "threads": [asdict(one) for one in self.threads],
            "most_threads": self.most_threads,
            "events": [asdict(one) for one in self.events],
            "heap": asdict(self.heap) | {"fragmentation": self.heap.fragmentation},
            "kernel_stack": {"size": self.kernel_stack, "used": self.kernel_stack_used},
            "equation": self.equation,
        }
