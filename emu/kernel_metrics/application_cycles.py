"""Cycles of the kernel's and the application's operations in the application's own run.

Input: a machine with an image that contains the kernel; nothing is instrumented. Output: one `Operation` per operation,
with every occurrence in the run. Numbers are exact: the times of the simulated instructions.

| operation | from | to |
|---|---|---|
| preemption: A -> B | request of the slice interrupt | first instruction of B |
| yield: A -> B | call of Sys_Yield | first instruction of B |
| EVENT: send to H | first instruction of the sending call | first instruction of handler H |
| EVENT: send to thread T | the same | first instruction of the waiting thread T |
| handler H | first instruction | return |
| interrupt I: request to entry | rise of the flag | first instruction of the handler |
| interrupt I: entry to exit | first instruction of the handler | next instruction of the interrupted code |
| interrupts masked at N | first cycle at priority N or above | first cycle below, or a sleep |
| wake-up of T | T becomes ready | first instruction of T |
| function F, interval A..B | first instruction of F, or A | return of F, or B |
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Final

from emu.debug.unwind import RETURN_BYTES
from emu.dspic30f.exceptions.interrupts import Accepted
from emu.dspic30f.state.state import STACK_POINTER
from emu.kernel_metrics.application_memory import ENTRY_REGISTER, SCHEDULER
from emu.kernel_metrics.cycle_results import ApplicationCycles, Operation
from emu.kernel_metrics.heap import Heap
from emu.kernel_metrics.kernel_structures import KernelStructures, event_name
from emu.kernel_metrics.observation import Observation

if TYPE_CHECKING:
    from emu.machine.machine import Machine

CALL_CYCLES: Final = 2
"""Cycles of CALL and RCALL (isa.md §13.1)."""
SLICE_VECTORS: Final = ("T2Interrupt", "C2Interrupt")
"""Vectors whose handler switches threads: the end of a slice, and a forced one (port/dspic30f/hal_port.h)."""
MAIN: Final = "main"
EVENT_REGISTER, DATA_REGISTER = 1, 2
"""W1 and W2 hold the event and the event data of a handler (abi-elf.md §2)."""
MASKED: Final = "interrupts masked at {level}"
MOST_MASKABLE: Final = 7
"""Highest priority of an interrupt; exceptions above are traps (isa.md §14.1)."""


@dataclass(slots=True)
class _Sent:
    """A message on its way: the cycle of the sending call, and the threads that it has woken."""

    cycle: int
    event: int
    exceptions: int
    readers: set[int] = field(default_factory=set)


@dataclass(slots=True)
class _Window:
    """An operation that has begun."""

    begin: int
    exceptions: int
    context: int = 0
    """Control block of the thread; 0 for the kernel stack."""
    stolen: int = 0
    """Cycles that the context had lost to interrupts and other threads when the window began."""
    stack: int = 0
    """W15 at the first instruction of a call."""
    is_scheduled: bool = False
    """Whether a yielding thread has reached the scheduler."""


@dataclass(slots=True)
class _Interrupt:
    """A running interrupt handler."""

    name: str
    requested: int
    before: int
    """Cycle of the boundary at which the exception was accepted."""
    entered: int
    back: tuple[int, int]
    """Address and W15 of the interrupted code."""
    exceptions: int


class _Run:
    """Recognises the beginnings and ends of operations while the machine runs."""

    def __init__(self, machine: Machine, kernel: KernelStructures) -> None:
        self.operations: Final[dict[str, Operation]] = {}
        self.observation: Final = Observation(machine, logged=True)
        self._machine: Final = machine
        self._kernel: Final = kernel
        self._heap_begin = kernel.memory
        """End of the kernel stack; known when the first thread starts, after Sys_Init_Kernel."""
        self._began: int | None = None
        """Cycle at which the first thread starts: nothing before it is counted."""
        self._exceptions = 0
        self._last_exception = 0
        """Cycle at which the last handler was entered or left."""
        self._names: Final[dict[tuple[int, int], str]] = {}
        self._slice: _Window | None = None
        self._yield: _Window | None = None
        self._left: Final[dict[int, int]] = {}
        """Cycle at which each thread left the CPU."""
        self._stolen: Final[Counter[int]] = Counter()
        """Cycles that each context has lost to interrupts and other threads."""
        self._ready: Final[dict[int, tuple[_Window, _Sent | None]]] = {}
        self._sending: Final[dict[int, _Window]] = {}
        self._sent: Final[dict[int, _Sent]] = {}
        self._handlers: Final[set[int]] = set()
        self._interrupts: Final[list[_Interrupt]] = []
        self._masked: Final[dict[int, _Window]] = {}
        self._calls: Final[dict[str, list[_Window]]] = {}
        self._returns: Final[set[tuple[str, int]]] = set()
        self._intervals: Final[dict[str, _Window]] = {}
        self._connect()

    def _connect(self) -> None:
        kernel, observation = self._kernel, self.observation
        observation.at(kernel.code("os_thread_start"), self._thread_starts)
        for name in SCHEDULER:
            observation.at(kernel.code(name), self._reaches_scheduler)
        for name, callback in (
            ("ring_append", self._becomes_ready), ("Sys_Yield", self._yields), ("Sys_Send_Event", self._sends),
        ):  # fmt: skip
            if kernel.image.symbols.find(name) is not None:  # the linker removes what the application does not call
                observation.at(kernel.code(name), callback)
        observation.on_change(kernel.queue_end, self._queued)
        observation.level_changed = self._level_changes
        observation.entering = self._entering
        observation.entered = self._entered
        observation.slept = self._slept

    # The machine between two instructions

    def _running(self) -> int:
        return self._machine.peek(self._kernel.running)

    def _context(self) -> int:
        """Return the control block of the running thread, 0 on the kernel stack."""
        on_kernel_stack = self._kernel.memory <= self._machine.w[STACK_POINTER] < self._heap_begin
        return 0 if on_kernel_stack else self._running()

    def _window(self, begin: int | None = None) -> _Window:
        context = self._context()
        begin = self._machine.cycle if begin is None else begin
        return _Window(begin, self._exceptions, context, self._stolen[context], self._machine.w[STACK_POINTER])

    def _add(self, name: str, window: _Window, end: int, stolen: int = 0) -> None:
        if self._began is None or window.begin < self._began:
            return  # part of the start-up
        calm = window.exceptions == self._exceptions
        operation = self.operations.setdefault(name, Operation(name))
        operation.add(window.begin, end, stolen, self.observation.log if calm else None)

    def _name(self, pcb: int) -> str:
        """Return the name of a thread's entry function; "main" for the system thread, empty for a new thread."""
        pid = self._kernel.pid(self._machine, pcb)
        return self._names.get((pcb, pid), "" if pid else MAIN)

    # Threads

    def _thread_starts(self) -> None:
        pcb = self._running()
        if self._began is None:
            self._began = self._machine.cycle
            self._heap_begin = self._kernel.memory_end - Heap(self._machine).capacity
        name = self._kernel.function_name(self._machine.w[ENTRY_REGISTER])
        self._names[pcb, self._kernel.pid(self._machine, pcb)] = name
        self._ready.pop(pcb, None)  # entry of an earlier thread at the same address
        self._thread_runs(self._machine.cycle)

    def _yields(self) -> None:
        if self.observation.level == 0:
            self._yield = self._window(self._machine.cycle - CALL_CYCLES)

    def _reaches_scheduler(self) -> None:
        self._left.setdefault(self._running(), self._machine.cycle)
        if self._yield is not None:
            self._yield.is_scheduled = True

    def _becomes_ready(self) -> None:
        pcb = self._machine.w[0]
        if not self._kernel.is_woken(self._machine, pcb):
            return  # a new thread
        sent = self._sent.get(self._machine.peek(pcb + self._kernel.result_offset))
        if sent is not None:
            if pcb in sent.readers:
                sent = None  # the thread still holds this message from its last wait
            else:
                sent.readers.add(pcb)
        self._ready[pcb] = self._window(), sent

    def _thread_runs(self, cycle: int) -> None:
        """Complete the operations that end with the first instruction of the running thread."""
        pcb = self._running()
        if not self._name(pcb):
            return  # `_thread_starts` follows, where the thread's entry function is known
        left = self._left.pop(pcb, None)
        if left is not None:
            self._stolen[pcb] += cycle - left
        if self._slice is not None and self._name(self._slice.context):
            self._add(self._switch("preemption", "slice end", self._slice.context, pcb), self._slice, cycle)
        self._slice = None
        if self._yield is not None and self._yield.is_scheduled:
            self._add(self._switch("yield", "yield", self._yield.context, pcb), self._yield, cycle)
            self._yield = None
        if pcb in self._ready:
            ready, sent = self._ready.pop(pcb)
            self._add(f"wake-up of {self._name(pcb)}", ready, cycle)
            if sent is not None:
                to = f"{event_name(sent.event)}: send to thread {self._name(pcb)}"
                self._add(to, _Window(sent.cycle, sent.exceptions), cycle)

    def _switch(self, what: str, alone: str, before: int, now: int) -> str:
        if before == now:
            return f"{alone}: {self._name(now)} continues"
        return f"{what}: {self._name(before)} -> {self._name(now)}"

    # Messages

    def _sends(self) -> None:
        self._sending[self._sender()] = self._window()

    def _sender(self) -> int:
        """Return a key of the code that runs: the thread, or a level of interrupts on the kernel stack."""
        return self._context() or -1 - len(self._interrupts)

    def _queued(self, _old: int, new: int) -> None:
        kernel, machine = self._kernel, self._machine
        if not kernel.memory <= new < kernel.memory_end:
            return  # the queue is empty again
        event, _size = kernel.message(machine, new)
        if not event:
            return  # not a message: a block that a driver returns to the kernel
        begin = self._sending.pop(self._sender(), None) or self._window()
        self._sent[new] = _Sent(begin.begin, kernel.event_id(machine, event), begin.exceptions)
        for _pid, pointer in kernel.subscriptions(machine, event):
            address = kernel.target(pointer)
            if address not in self._handlers:
                self._handlers.add(address)
                self.observation.at(address, partial(self._handler_begins, kernel.function_name(pointer)))

    def _handler_begins(self, name: str) -> None:
        sent = self._sent.get(self._machine.w[DATA_REGISTER])
        if sent is None or sent.event != self._machine.w[EVENT_REGISTER]:
            return  # the application calls the handler itself
        to = f"{event_name(sent.event)}: send to {name}"
        self._add(to, _Window(sent.cycle, sent.exceptions), self._machine.cycle)
        self._begin_call(f"handler {name}")

    # Calls and intervals

    def watch_function(self, name: str, address: int) -> None:
        """Measure all calls of the function at an address."""
        self.observation.at(address, lambda: self._begin_call(f"function {name}"))

    def watch_interval(self, name: str, begin: int, end: int) -> None:
        """Measure from each execution of the instruction at `begin` to the next one of `end`."""
        self.observation.at(end, lambda: self._end_interval(name))
        self.observation.at(begin, lambda: self._intervals.__setitem__(name, self._window()))

    def _end_interval(self, name: str) -> None:
        window = self._intervals.pop(name, None)
        if window is not None:
            self._add(f"interval {name}", window, self._machine.cycle)

    def _begin_call(self, label: str) -> None:
        window, machine = self._window(), self._machine
        top = window.stack - RETURN_BYTES
        back = (machine.peek(top + 2) & 0x7F) << 16 | machine.peek(top)
        calls = self._calls.setdefault(label, [])
        calls[:] = [one for one in calls if (one.context, one.stack) != (window.context, window.stack)]
        calls.append(window)
        if (label, back) not in self._returns:
            self._returns.add((label, back))
            self.observation.at(back, lambda: self._end_call(label))

    def _end_call(self, label: str) -> None:
        context, stack = self._context(), self._machine.w[STACK_POINTER] + RETURN_BYTES
        calls = self._calls[label]
        for window in calls:
            if (window.context, window.stack) == (context, stack):
                calls.remove(window)
                self._add(label, window, self._machine.cycle, self._stolen[context] - window.stolen)
                return

    # Interrupts and priorities

    def _entering(self, accepted: Accepted, cycle: int, pc: int) -> None:
        name = accepted.vector.name
        self._exceptions += 1
        if name in SLICE_VECTORS:
            self._yield = None
            self._left.setdefault(self._running(), cycle)
            self._slice = self._window(accepted.since)
        elif accepted.level <= MOST_MASKABLE:
            calm = self._last_exception < accepted.since
            back = pc, self._machine.w[STACK_POINTER]
            exceptions = self._exceptions if calm else -1
            self._interrupts.append(_Interrupt(name, accepted.since, cycle, cycle, back, exceptions))
        self._last_exception = cycle

    def _entered(self, accepted: Accepted, _cycle: int, _pc: int) -> None:
        if not self._interrupts or accepted.vector.name in SLICE_VECTORS or accepted.level > MOST_MASKABLE:
            return
        now = self._interrupts[-1]
        now.entered = self._machine.cycle
        name = f"interrupt {now.name.removesuffix('Interrupt')}"
        self._add(f"{name}: request to entry", _Window(now.requested, now.exceptions), now.entered)
        now.exceptions = self._exceptions

    def _leave_interrupts(self, cycle: int) -> None:
        """Complete the interrupt handler that has just returned, if one has."""
        back = self._machine.pc, self._machine.w[STACK_POINTER]
        depth = next((n for n, one in reversed(list(enumerate(self._interrupts))) if one.back == back), None)
        if depth is None:
            return
        ended = self._interrupts[depth]
        del self._interrupts[depth:]
        self._last_exception = cycle
        name = f"interrupt {ended.name.removesuffix('Interrupt')}"
        self._add(f"{name}: entry to exit", _Window(ended.entered, ended.exceptions), cycle)
        if not self._interrupts:
            self._stolen[self._context()] += cycle - ended.before

    def _level_changes(self, cycle: int, old: int, new: int) -> None:
        if new < old and self._interrupts:
            self._leave_interrupts(cycle)
        for level in range(new + 1, old + 1):
            window = self._masked.pop(level, None)
            if window is not None:
                self._add(MASKED.format(level=level), window, cycle)
        for level in range(old + 1, new + 1):
            self._masked[level] = _Window(cycle, self._exceptions)
        if new == 0 and not self.observation.is_entering:
            self._thread_runs(cycle)

    def _slept(self, begin: int, end: int) -> None:
        for level, window in self._masked.items():
            if begin > window.begin:
                self._add(MASKED.format(level=level), window, begin)
            self._masked[level] = _Window(end, self._exceptions)


def measure(
    machine: Machine,
    cycles: int,
    functions: Sequence[tuple[str, int]] = (),
    intervals: Sequence[tuple[str, int, int]] = (),
) -> ApplicationCycles:
    """Run a freshly loaded machine for `cycles` Tcy and return the operations that occurred.

    `functions` are (name, address), `intervals` (name, first address, last address). The machine needs the plain
    engine. Raises MeasureError if the image has no kernel with debug information.
    """
    assert machine.image is not None
    run = _Run(machine, KernelStructures(machine.image))
    for name, address in functions:
        run.watch_function(name, address)
    for name, begin, end in intervals:
        run.watch_interval(name, begin, end)
    run.observation.start()
    try:
        stop = machine.advance(machine.cycle + cycles)
    finally:
        run.observation.stop()
    operations = dict(sorted(run.operations.items()))
    for level in range(1, MOST_MASKABLE):  # a level at which the firmware never runs repeats the next higher one
        lower, higher = (operations.get(MASKED.format(level=one)) for one in (level, level + 1))
        if lower is not None and higher is not None and lower.all == higher.all:
            del operations[lower.name]
    return ApplicationCycles(float(cycles / machine.hz), operations, stop)
