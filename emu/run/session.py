"""One run of a machine with people attached: slices of cycles, live or recorded input, pace, a clean stop.

What enters: a machine, ports, stamps, limits. What leaves: a `Stop`. Slices change nothing the firmware can see: input
is stamped with the cycle it is handed over in, and the same stamps give the same run.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from dataclasses import replace
from types import FrameType
from typing import TYPE_CHECKING, Any, Final, TextIO

from emu.run.console import Port, wait_for_input
from emu.run.input_log import TimestampedInput

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

SLICE_SECONDS: Final = 0.02
"""Host time a slice should take: output and Ctrl-C wait no longer than this."""
FIRST_SLICE, SHORTEST_SLICE, LONGEST_SLICE = 20_000, 2_000, 100_000_000
"""Tcy."""
PACED_SLICES_PER_SECOND: Final = 200
POLL_SECONDS: Final = 0.1
"""Longest wait without looking for Ctrl-C."""
STUCK_SECONDS: Final = 3.0
"""How long a run may take to notice that it should end."""
FOREVER: Final = 1 << 62
"""Limit in Tcy when there is none: 10,000 years."""


class Session:
    """Runs a machine with its UARTs connected to `ports` (UART number to port)."""

    def __init__(
        self,
        machine: Machine,
        ports: dict[int, Port],
        *,
        limit: int = FOREVER,
        replay: list[TimestampedInput] | None = None,
        record: TextIO | None = None,
        realtime: bool = False,
        advance: Callable[[int], Stop | None] | None = None,
        links: dict[int, Any] | None = None,
    ) -> None:
        """`limit`: last cycle. `realtime`: no faster than the wall clock. `advance(cycle)` replaces the machine's
        `run_until`, for traces. `links`: what lies between a UART's pins and its port, by UART number: `listen` and
        `feed` like the UART's own."""
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
        """Run to the end; returns how it ended and the seconds of host time it took."""
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
            stop = self._advance(min(self.limit, machine.cycle + slice_cycles, self._next_stamp()))
            self._show_output()
            if stop is not None and stop.reason == "halt":
                stop = self._outlive(stop)
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
        """Ctrl-C and SIGTERM end the run at the next boundary; the second one, or a run that is stuck, at once."""
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

    def _next_stamp(self) -> int:
        return self._replay[-1].cycle if self._replay else FOREVER

    def _take_input(self, cycle: int) -> bool:
        """Hand over what has arrived by now, stamped with `cycle`; whether there was any."""
        taken = False
        while self._replay and self._replay[-1].cycle <= cycle:
            self._hand_over(self._replay.pop())
            taken = True
        for number, port in self.ports.items():
            data = port.read()
            if data:
                self._hand_over(TimestampedInput(cycle, number, data))
                taken = True
        return taken

    def _hand_over(self, stamp: TimestampedInput) -> None:
        """Bytes for a running machine wait until its receiver is on; for a sleeping one they come at their date."""
        late = stamp.cycle > self.machine.cycle
        self._links[stamp.uart].feed(stamp.data, stamp.cycle if late else None)
        if self._record is not None:
            stamp.write(self._record)

    def _wall_cycle(self) -> int:
        """The cycle a robot started together with this run would be in."""
        return self._first_cycle + round((time.perf_counter() - self._start) * self._hz)

    def _outlive(self, stop: Stop) -> Stop | None:
        """A machine sleeps with nothing of its own to wake it. None if input brings it back, else how the run ends."""
        machine = self.machine
        if self._replay:
            return None if self._take_input(self._next_stamp()) else stop
        sources = [port for number, port in self.ports.items() if self._can_wake(number)]
        while any(port.in_fd is not None for port in sources):
            if self.interrupted:
                return machine.stopped("interrupted")
            patient = self._realtime or self.limit == FOREVER
            ready = wait_for_input(sources, POLL_SECONDS if patient else 0)
            now = max(machine.cycle, self._wall_cycle() if self._realtime else 0)
            if now >= self.limit or not (ready or patient):
                return replace(stop, reason="limit", cycle=self.limit)
            if ready and self._take_input(now):
                return None
        return stop

    def _can_wake(self, number: int) -> bool:
        """Whether a byte for this UART would wake the CPU: receiver on, its interrupt enabled above priority 0."""
        machine = self.machine
        uart = machine.uart[number]
        source = machine.chip.interrupts[uart.site.rx_irq]
        enabled = machine.peek(source.enable[0]) >> source.enable[1] & 1
        priority = machine.peek(source.priority[0]) >> source.priority[1] & 7
        return bool(uart.is_enabled and enabled and priority)


def _adapted(cycles: int, seconds: float) -> int:
    """Length of the next slice after one of `cycles` took `seconds`."""
    if seconds < SLICE_SECONDS / 2:
        return min(2 * cycles, LONGEST_SLICE)
    if seconds > SLICE_SECONDS * 2:
        return max(cycles // 2, SHORTEST_SLICE)
    return cycles
