"""Memory of an application of OpenSwarm: what its threads, events, messages and drivers allocate in a run.

Input: a machine with an image that contains the kernel; nothing is instrumented. Output: `ApplicationMemory`. The
kernel paints the stack of each thread, and this module that of `main`, so the high-water marks are exact. Messages are
counted when they are queued. The allocations are read whenever a thread enters the scheduler, where the kernel's lists
are consistent.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, Final

from emu.debug.inspector import Inspector
from emu.debug.threads import STACK_FILL
from emu.debug.unwind import RETURN_BYTES
from emu.image.footprint import pieces
from emu.image.model import Image
from emu.kernel_metrics.blame import short
from emu.kernel_metrics.heap import Heap
from emu.kernel_metrics.kernel_structures import (
    KernelMemory,
    KernelStructures,
    ThreadMemory,
    event_name,
)
from emu.kernel_metrics.memory_results import ApplicationMemory, EventUse, HeapUse, ThreadUse
from emu.kernel_metrics.observation import HookObservation, Observation, stores_to
from emu.kernel_metrics.owners import APPLICATION, owner_of_module
from emu.kernel_metrics.target import WORD

if TYPE_CHECKING:
    from emu.machine.machine import Machine

RETURNED_BLOCK: Final = -1
"""Event identifier of a queued block that a driver returns to the kernel."""
ENTRY_REGISTER: Final = 8
"""W8 holds the entry function at `os_thread_start` (firmware/openswarm/port/dspic30f/switch.S)."""
SYSTEM_THREAD: Final = "main"
SCHEDULER: Final = ("os_schedule", "os_yield", "os_slice_end")
"""Functions in which the kernel, on its own stack, chooses the next thread (kernel/scheduler.c)."""


class _Run:
    """Collects the memory use while the machine runs."""

    def __init__(self, machine: Machine, kernel: KernelStructures) -> None:
        self.machine: Final = machine
        self.kernel: Final = kernel
        self.threads: Final[dict[str, ThreadUse]] = {}
        self.most_threads = 0
        self.events: Final[dict[int, EventUse]] = {}
        self.peak = 0
        self.fullest = KernelMemory(0, [], {}, 0)
        self.drivers_peak = 0
        self._alive: Final[dict[int, tuple[int, str]]] = {}
        """PID and entry function of the threads in memory, by control block."""
        self._lines: Final[dict[int, str]] = {}
        """Source line that started the thread, by control block."""
        self._inspector: Final = Inspector(machine)
        self._is_changed = False
        self._stack_of_main = range(0)
        """Addresses of the stack of `main` up to its limit (SPLIM)."""
        observation = self.observation = Observation(machine) if machine.engine == "plain" else HookObservation(machine)
        observation.at(kernel.code("os_thread_start"), self._thread_starts)
        for name, callback in (
            (SYSTEM_THREAD, self._main_starts), ("ring_append", self._enters_ring),
            ("Sys_Register_Event", self._names_event), ("Sys_Subscribe_to_Event", self._names_event),
        ):  # fmt: skip
            if machine.image is not None and machine.image.symbols.find(name) is not None:
                observation.at(kernel.code(name), callback)
        observation.on_change(kernel.statistics, self._heap_changes)
        observation.on_change(kernel.queue_end, self._queue_changes)
        for name in SCHEDULER:  # the kernel's lists are consistent when a thread enters the scheduler
            observation.at(kernel.code(name), self._enters_scheduler)

    def _calling_line(self) -> str:
        """Return the source line outside the kernel that has led to the present call."""
        for frame in self._inspector.frames()[1:]:
            if frame.line is not None and owner_of_module(frame.line.file) == APPLICATION:
                return f"{short(frame.line.file)}:{frame.line.line}"
        return ""

    def _enters_ring(self) -> None:
        pcb = self.machine.w[0]
        if self.kernel.is_woken(self.machine, pcb):
            return
        self._lines[pcb] = self._calling_line()
        memory = self.kernel.thread(self.machine, pcb)
        if memory.block:  # the thread may be ended before it runs
            self._thread(memory, self.kernel.function_name(self._entry(memory)))

    def _names_event(self) -> None:
        line = self._calling_line()
        if line:
            self._event(self.machine.w[0]).line = line

    def _main_starts(self) -> None:
        """Paint the unused stack of `main`, which the kernel does not paint."""
        if self._stack_of_main:
            return
        top, end = self.machine.w[15], self.machine.state.splim + WORD
        if top < end <= self.machine.record.data_end:
            self._stack_of_main = range(top - RETURN_BYTES, end)
            self.machine.poke(top, int.from_bytes(bytes([STACK_FILL]) * (end - top), "little"), end - top)

    def _measure_main(self) -> None:
        """Add the system thread."""
        stack = self._stack_of_main
        if not stack:
            return
        used = len(self.machine.peek_bytes(stack.start, len(stack)).rstrip(bytes([STACK_FILL])))
        place = self._inspector.image.lines.find(self.kernel.code(SYSTEM_THREAD))
        self.threads[SYSTEM_THREAD] = ThreadUse(
            SYSTEM_THREAD, 0, len(stack), used, len(stack) - used, 0, self.kernel.pcb_bytes, 0,
            line=f"{short(place.file)}:{place.line}" if place is not None else "",
        )  # fmt: skip

    def _thread_starts(self) -> None:
        pcb = self.machine.peek(self.kernel.running)
        self._thread(self.kernel.thread(self.machine, pcb), self.kernel.function_name(self.machine.w[ENTRY_REGISTER]))

    def _thread(self, memory: ThreadMemory, entry: str) -> None:
        """Add a thread, unless it is known."""
        if self._alive.get(memory.pcb, (0, ""))[0] == memory.pid:
            return
        self._alive[memory.pcb] = memory.pid, entry
        use = self.threads.get(entry)
        if use is None:
            line = self._lines.get(memory.pcb, "")
            self.threads[entry] = ThreadUse(
                entry, memory.pid, memory.stack, 0, memory.usable, memory.stack - memory.usable, self.kernel.pcb_bytes,
                memory.size, line=line,
            )  # fmt: skip
        else:
            use.started += 1
            use.stack, use.heap = max(use.stack, memory.stack), max(use.heap, memory.size)

    def _heap_changes(self, old: int, new: int) -> None:
        self.peak = max(self.peak, new)
        self._is_changed = True
        if new >= old:
            return
        if old - new < self.kernel.pcb_bytes or not self._alive:
            return
        present = self.kernel.control_blocks(self.machine)
        for pcb in [pcb for pcb in self._alive if pcb not in present]:
            memory = self.kernel.thread(self.machine, pcb)
            if memory.size == old - new:  # the block is freed now and still painted
                self._measure(memory)
                del self._alive[pcb]

    def _measure(self, memory: ThreadMemory) -> None:
        use = self.threads.get(self._alive.get(memory.pcb, (0, ""))[1])
        if use is not None and memory.block:
            use.used, use.free = max(use.used, memory.used), min(use.free, memory.unused)

    def _queue_changes(self, _old: int, new: int) -> None:
        if not self.kernel.memory <= new < self.kernel.memory_end:
            return  # the queue is empty again
        event, _size = self.kernel.message(self.machine, new)
        if not event:
            return
        identifier = self.kernel.event_id(self.machine, event)
        queued = self.kernel.queued(self.machine)
        use = self._event(identifier)
        use.sent += 1
        messages, size = queued.get(identifier, (1, 0))
        if messages > use.peak_messages or size > use.peak_bytes:
            use.sender = self._calling_line() or use.sender
        use.peak_messages, use.peak_bytes = max(use.peak_messages, messages), max(use.peak_bytes, size)

    def _event(self, identifier: int) -> EventUse:
        return self.events.setdefault(identifier, EventUse(event_name(identifier), identifier, 0, 0, 0, 0, 0))

    def _enters_scheduler(self) -> None:
        if self._is_changed:
            self._is_changed = False
            self.read()

    def read(self) -> KernelMemory:
        """Read all allocations. A thread must be running, or the CPU must be idle."""
        found = self.kernel.read(self.machine)
        for one in found.events.values():
            use = self._event(one.identifier)
            use.subscriptions, use.by_drivers = (
                max(use.subscriptions, one.subscriptions),
                max(use.by_drivers, one.by_drivers),
            )
        for kind, counts in zip(("cleanups", "mutexes"), self.kernel.nodes(self.machine), strict=True):
            for owner, count in counts.items():
                use_of = self.threads.get(self._alive.get(owner, (0, ""))[1])
                if use_of is not None:
                    setattr(use_of, kind, max(getattr(use_of, kind), count))
        self.most_threads = max(self.most_threads, sum(bool(one.block) for one in found.threads))
        self.drivers_peak = max(self.drivers_peak, self.by_kind(found)["drivers"])
        if found.heap_used > self.fullest.heap_used:
            self.fullest = found
        return found

    def finish(self) -> None:
        """Read the stacks at the end of the run."""
        for pcb in self.kernel.control_blocks(self.machine):
            memory = self.kernel.thread(self.machine, pcb)
            if memory.block:
                self._thread(memory, self.kernel.function_name(self._entry(memory)))
                self._measure(memory)
        self._measure_main()

    def _entry(self, memory: ThreadMemory) -> int:
        """Return the entry function of a thread that has not run yet, from its initial frame (cpu.c)."""
        return self.machine.peek(memory.pcb - memory.stack + 4)

    def by_kind(self, memory: KernelMemory) -> dict[str, int]:
        """Return the allocated bytes by kind. Their sum is the allocated memory."""
        kernel = self.kernel
        kinds = {
            "threads": sum(one.size for one in memory.threads),
            "events": kernel.event_bytes * len(memory.events),
            "subscriptions": kernel.subscription_bytes * sum(one.subscriptions for one in memory.events.values()),
            "gates": kernel.event_bytes * memory.gates,
            "messages": sum(size for event, size in memory.queued_bytes.items() if event != RETURNED_BLOCK)
            + memory.held_bytes,
        }
        return kinds | {"drivers": memory.heap_used - sum(kinds.values())}


def engine_for(image: Image) -> str:
    """Return the fastest engine that can observe an image: plain if the kernel's counters are stored through pointers.

    Raises MeasureError if the image has no kernel with debug information.
    """
    kernel = KernelStructures(image)
    known = all(stores_to(image, word) is not None for word in (kernel.statistics, kernel.queue_end))
    return "auto" if known else "plain"


def measure(machine: Machine, cycles: int) -> ApplicationMemory:
    """Run a freshly loaded machine for `cycles` Tcy and return its memory use.

    `engine_for` names an engine that can observe the image. Raises MeasureError if the image has no kernel with debug
    information.
    """
    assert machine.image is not None
    kernel = KernelStructures(machine.image)
    run = _Run(machine, kernel)
    run.observation.start()
    try:
        stop = machine.advance(machine.cycle + cycles)
    finally:
        run.observation.stop()
    run.finish()
    last = run.read()
    kinds = run.by_kind(last)
    heap = Heap(machine)
    holes = heap.free_blocks()
    free = sum(holes)
    statistics = HeapUse(
        heap.capacity, run.peak, last.heap_used, free, max(holes, default=0), len(holes), drivers_peak=run.drivers_peak,
        fullest=run.by_kind(run.fullest), **kinds,
    )  # fmt: skip
    stack = kernel.memory_end - kernel.memory - statistics.capacity
    painted = machine.peek_bytes(kernel.memory, stack)
    used = len(painted.rstrip(bytes([STACK_FILL])))
    return ApplicationMemory(
        float(cycles / machine.hz), sorted(run.threads.values(), key=lambda one: one.pid), run.most_threads,
        sorted(run.events.values(), key=lambda one: one.identifier), statistics, stack, used,
        _equation(machine, kernel, run, statistics), stop,
    )  # fmt: skip


def _equation(machine: Machine, kernel: KernelStructures, run: _Run, heap: HeapUse) -> dict[str, Any]:
    """Return the memory equation with the application's numbers when its allocations were largest.

    RAM = A + B n + C m + D s + sum over pending messages of (E + d). The stacks of an application differ, so B n is a
    sum over its threads.
    """
    assert machine.image is not None
    static: Counter[str] = Counter()
    for piece in pieces(machine.image):
        if piece.name != "_os_memory":
            static[owner_of_module(piece.module)] += piece.ram
    stack = kernel.memory_end - kernel.memory - heap.capacity
    fullest = run.fullest
    threads = [one for one in fullest.threads if one.block]
    messages = fullest.held + sum(count for event, count in fullest.queued.items() if event != RETURNED_BLOCK)
    constant = sum(static.values()) + stack
    kinds = run.by_kind(fullest)
    return {
        "A": constant,
        "A_parts": dict(sorted(static.items())) | {"kernel stack": stack},
        "B": kernel.pcb_bytes,
        "stacks": {str(one.pid): one.size - kernel.pcb_bytes for one in threads},
        "C": kernel.event_bytes,
        "D": kernel.subscription_bytes,
        "E": kernel.message_bytes,
        "n": len(threads),
        "m": len(fullest.events),
        "s": sum(one.subscriptions for one in fullest.events.values()),
        "messages": messages,
        "payload": kinds["messages"] - kernel.message_bytes * messages,
        "gates": kinds["gates"],
        "drivers": kinds["drivers"],
        "ram": constant + fullest.heap_used,
    }
