"""One run of a machine with people attached: slices of cycles, live or recorded input, pace, a clean stop.

What enters: a machine, ports, stamps, limits. What leaves: a `Stop`. Slices change nothing the firmware can see: input
is stamped with the cycle it is handed over, and the same stamps give the same run.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any, Final, TextIO

from emu.console import Port, wait_for_input
from emu.stamps import Stamp

if TYPE_CHECKING:
    from emu.machine import Machine, Stop

SLICE_SECONDS: Final = 0.02
"""Host time a slice should take: output and Ctrl-C wait no longer than this."""
FIRST_SLICE, SHORTEST_SLICE, LONGEST_SLICE = 20_000, 2_000, 100_000_000
"""Tcy."""
POLL_SECONDS: Final = 0.1
"""Longest wait without looking for Ctrl-C."""
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
        replay: list[Stamp] | None = None,
        record: TextIO | None = None,
        realtime_hz: int = 0,
        advance: Callable[[int], Stop | None] | None = None,
    ) -> None:
        """`realtime_hz`: cycles per second of the wall clock, 0 for as fast as possible. `advance(cycle)` replaces
        the machine's `run_until`, for traces."""
        self.machine: Final = machine
        self.ports: Final = ports
        self.limit: Final = limit
        self.interrupted = False
        self._replay: Final = list(reversed(replay or []))
        self._record: Final = record
        self._hz: Final = realtime_hz
        self._advance: Final = advance or machine.run_until
        self._sent: Final = {number: bytearray() for number in ports}
        self._held: Final = {number: bytearray() for number in ports}
        for number in ports:
            machine.uart[number].on_byte = self._collector(number)

    def run(self) -> tuple[Stop, float]:
        """Run to the end; returns how it ended and the seconds of host time it took."""
        earlier = [(number, signal.signal(number, self._on_signal)) for number in (signal.SIGINT, signal.SIGTERM)]
        start = time.perf_counter()
        try:
            stop = self._loop(start)
        finally:
            for number, handler in earlier:
                signal.signal(number, handler)
        return stop, time.perf_counter() - start

    def _loop(self, start: float) -> Stop:
        slice_cycles = FIRST_SLICE
        first_cycle = self.machine.cycle
        while not self.interrupted:
            self._take_input()
            before = time.perf_counter()
            stop = self._advance(min(self.limit, self.machine.cycle + slice_cycles, self._next_stamp()))
            self._show_output()
            if stop is not None and stop.reason not in ("limit", "halt"):
                return stop
            if stop is not None and stop.reason == "halt" and not self._outlive(stop):
                return stop
            if self.machine.cycle >= self.limit:
                break
            if self._hz:
                slice_cycles = self._hz // 200
                self._keep_pace(start, first_cycle)
            else:
                slice_cycles = _adapted(slice_cycles, time.perf_counter() - before)
        return self.machine.stopped("interrupted" if self.interrupted else "limit")

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True

    def _collector(self, number: int) -> Callable[[int, int], Any]:
        sent = self._sent[number]
        return lambda byte, cycle: sent.append(byte & 0xFF)

    def _show_output(self) -> None:
        for number, sent in self._sent.items():
            if sent:
                data = bytes(sent)
                sent.clear()
                self.ports[number].write(data)

    def _next_stamp(self) -> int:
        return self._replay[-1].cycle if self._replay else FOREVER

    def _take_input(self) -> None:
        """Hand over what has arrived, or what the record says arrived by now."""
        machine = self.machine
        while self._replay and self._replay[-1].cycle <= machine.cycle:
            stamp = self._replay.pop()
            machine.uart[stamp.uart].feed(stamp.data, stamp.cycle)
        for number, port in self.ports.items():
            held = self._held[number]
            held += port.read()
            if held and machine.uart[number].receiving:
                self._feed(Stamp(machine.cycle, number, bytes(held)))
                held.clear()

    def _feed(self, stamp: Stamp) -> None:
        self.machine.uart[stamp.uart].feed(stamp.data, stamp.cycle)
        if self._record is not None:
            stamp.write(self._record)

    def _outlive(self, stop: Stop) -> bool:
        """Whether a machine that sleeps with nothing of its own to wake it goes on: input is still to come."""
        if self._replay:
            self._feed(self._replay.pop())
            return True
        waiting = [port for number, port in self.ports.items() if self.machine.uart[number].wakes]
        while any(port.in_fd is not None for port in waiting) and not self.interrupted:
            if wait_for_input(waiting, POLL_SECONDS):
                return True
        return False
