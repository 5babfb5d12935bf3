"""Interactive run of a machine: time slices, live or recorded input, pacing, controlled stop.

Inputs: a machine, ports, timestamped input, limits. Output: a `Stop`. Slices do not affect the firmware: input is
timestamped with the cycle of its delivery, and equal timestamped input gives an equal run.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from dataclasses import replace
from types import FrameType
from typing import TYPE_CHECKING, Any, Final, TextIO

from emu.run.input_log import TimestampedInput
from emu.run.uart_backends import ConsolePort, wait_for_input

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

SLICE_SECONDS: Final = 0.02
"""Target host time of a slice in s, which is the maximum delay of output and Ctrl-C."""
FIRST_SLICE, SHORTEST_SLICE, LONGEST_SLICE = 10_000, 2_000, 100_000_000
"""Initial, minimum and maximum length of a slice in Tcy. The native engine interprets the first slice."""
PACED_SLICES_PER_SECOND: Final = 200
POLL_SECONDS: Final = 0.1
"""Maximum time in s of a wait for input before Ctrl-C is checked."""
STUCK_SECONDS: Final = 3.0
"""Host time in s after Ctrl-C at which a run that has not ended is aborted."""
FOREVER: Final = 1 << 62
"""Limit in Tcy if the user gives none: 10,000 years."""


class Session:
    """Runner of a machine whose UARTs are connected to `ports` (UART number to port)."""

    def __init__(
        self,
        machine: Machine,
        ports: dict[int, ConsolePort],
        *,
        limit: int = FOREVER,
        replay: list[TimestampedInput] | None = None,
        record: TextIO | None = None,
        realtime: bool = False,
        advance: Callable[[int], Stop | None] | None = None,
        links: dict[int, Any] | None = None,
    ) -> None:
        """Connect the machine's UARTs to `ports`.

        `limit`: last cycle. `realtime`: run no faster than the wall clock. `advance(cycle)` replaces the machine's
        `run_until`, for traces. `links`: devices between a UART's pins and its port, by UART number; like a UART they
        have `listen` and `feed`.
        """
        self.machine: Final = machine
        self.ports: Final = ports
        self.limit: Final = limit
        self.interrupted = False
        self._replay: Final = list(reversed(replay or []))
        self._record: Final = record
        self._realtime: Final = realtime
        self._hz: Final = machine.peripherals.fcy
        self._advance: Final = advance or machine.advance
        self._links: Final = {number: (links or {}).get(number, machine.uart[number]) for number in ports}
        self._sent: Final = {number: bytearray() for number in ports}
        self._start = 0.0
        self._first_cycle: Final = machine.cycle
        self._removals: Final = [self._links[number].listen(self._collector(number), lazy=True) for number in ports]

    def run(self) -> tuple[Stop, float]:
        """Run until a stop. Return the stop and the host time in seconds."""
        earlier = [(number, signal.signal(number, self._on_signal)) for number in (signal.SIGINT, signal.SIGTERM)]
        self._start = time.perf_counter()
        try:
            stop = self._loop()
            if stop.reason not in ("limit", "interrupted"):
                for number in self.ports:
                    self.machine.uart[number].drain()
            self._show_output()
        finally:
            for remove in self._removals:
                remove()
            signal.setitimer(signal.ITIMER_REAL, 0)
            for number, handler in earlier:
                signal.signal(number, handler)
        return stop, time.perf_counter() - self._start

    def _loop(self) -> Stop:
        machine = self.machine
        slice_cycles = FIRST_SLICE
        while not self.interrupted:
            self._take_input(machine.cycle)
            before = time.perf_counter()
            stop = self._advance(min(self.limit, machine.cycle + slice_cycles, self._next_input_cycle()))
            self._show_output()
            if stop is not None and stop.reason == "halt":
                stop = self._wait_for_wakeup(stop)
            if stop is not None:
                return stop
            if self._realtime:
                slice_cycles = round(self._hz / PACED_SLICES_PER_SECOND)
                wait_for_input(list(self.ports.values()), (machine.cycle - self._wall_cycle()) / self._hz)
            if machine.cycle >= self.limit:
                return machine.stopped("limit")
            if not self._realtime:
                slice_cycles = _adapted(slice_cycles, time.perf_counter() - before)
        return machine.stopped("interrupted")

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        """Handle Ctrl-C and SIGTERM: end the run at the next boundary.

        The second signal, or `STUCK_SECONDS` without an end, aborts the run immediately.
        """
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True
        self.machine.interrupt()
        signal.signal(signal.SIGALRM, self._on_signal)
        signal.setitimer(signal.ITIMER_REAL, STUCK_SECONDS)

    def _collector(self, number: int) -> Callable[[int, int], Any]:
        sent = self._sent[number]
        return lambda byte, cycle: sent.append(byte & 0xFF)

    def _show_output(self) -> None:
        for number, sent in self._sent.items():
            if sent:
                data = bytes(sent)
                sent.clear()
                self.ports[number].write(data)

    # Input

    def _next_input_cycle(self) -> int:
        return self._replay[-1].cycle if self._replay else FOREVER

    def _take_input(self, cycle: int) -> bool:
        """Deliver the input that has arrived, with timestamp `cycle`. Return whether there was any."""
        taken = False
        while self._replay and self._replay[-1].cycle <= cycle:
            self._deliver(self._replay.pop())
            taken = True
        for number, port in self.ports.items():
            data = port.read()
            if data:
                self._deliver(TimestampedInput(cycle, number, data))
                taken = True
        return taken

    def _deliver(self, stamp: TimestampedInput) -> None:
        """Deliver input to the UART: at its future cycle, or now, waiting until the receiver is enabled."""
        late = stamp.cycle > self.machine.cycle
        self._links[stamp.uart].feed(stamp.data, stamp.cycle if late else None)
        if self._record is not None:
            stamp.write(self._record)

    def _wall_cycle(self) -> int:
        """Return the cycle that a real robot would have reached if it had started together with this run."""
        return self._first_cycle + round((time.perf_counter() - self._start) * self._hz)

    def _wait_for_wakeup(self, stop: Stop) -> Stop | None:
        """Wait for input that can wake a machine which has no internal wake-up source.

        Return None when such input arrives, otherwise the stop.
        """
        machine = self.machine
        if self._replay:
            return None if self._take_input(self._next_input_cycle()) else stop
        sources = [port for number, port in self.ports.items() if self._can_wake(number)]
        while any(port.in_fd is not None for port in sources):
            if self.interrupted:
                return machine.stopped("interrupted")
            may_wait = self._realtime or self.limit == FOREVER
            ready = wait_for_input(sources, POLL_SECONDS if may_wait else 0)
            now = max(machine.cycle, self._wall_cycle() if self._realtime else 0)
            if now >= self.limit or not (ready or may_wait):
                return replace(stop, reason="limit", cycle=self.limit)
            if ready and self._take_input(now):
                return None
        return stop

    def _can_wake(self, number: int) -> bool:
        """Whether a byte for this UART would wake the CPU: receiver on, interrupt enabled with a priority above 0."""
        machine = self.machine
        uart = machine.uart[number]
        source = machine.chip.interrupts[uart.site.rx_irq]
        enabled = machine.peek(source.enable[0]) >> source.enable[1] & 1
        priority = machine.peek(source.priority[0]) >> source.priority[1] & 7
        return bool(uart.is_enabled and enabled and priority)


def _adapted(cycles: int, seconds: float) -> int:
    """Return the length of the next slice, given that one of `cycles` took `seconds`."""
    if seconds < SLICE_SECONDS / 2:
        return min(2 * cycles, LONGEST_SLICE)
    if seconds > SLICE_SECONDS * 2:
        return max(cycles // 2, SHORTEST_SLICE)
    return cycles
