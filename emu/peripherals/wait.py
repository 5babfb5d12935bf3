"""Waiting for what a firmware says, in simulated time.

What enters: a pattern, a time. What leaves: the match, at the cycle in which its last byte has left the pin. Waiting is
deterministic: the same firmware and input give the same cycle.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, Final

from emu.peripherals.base import CpuSignals

Pattern = str | bytes | re.Pattern[bytes]
SHOWN: Final = 200
"""Bytes of what was heard that a message quotes."""


class ExpectError(AssertionError):
    """What was expected was not said in time; the text tells what was."""


class OutputMatcher:
    """Listens to one line from its first use on."""

    def __init__(self, name: str, wires: CpuSignals, fcy: Callable[[], float], now: Callable[[], int]) -> None:
        self._name: Final = name
        self._wires: Final = wires
        self._fcy: Final = fcy
        self._now: Final = now
        self._wanted: re.Pattern[bytes] | None = None
        self.heard: Final = bytearray()
        """Everything said since then."""
        self.place = 0
        """What lies before has been matched."""

    def hear(self, byte: int, _cycle: int) -> None:
        """A byte was said."""
        self.heard.append(byte & 0xFF)
        if self._wanted is not None and self._wanted.search(self.heard, self.place):
            self._wires.end_run()

    def expect(self, pattern: Pattern, within: float, drain: Callable[[], None]) -> re.Match[bytes]:
        """See `Uart.expect`."""
        wanted = compiled(pattern)
        cycles = max(1, round(within * self._fcy() / 1000))
        end = self._now() + cycles
        stop: Any = None
        while (found := wanted.search(self.heard, self.place)) is None:
            if self._now() >= end or (stop is not None and stop.reason not in ("limit", "interrupted")):
                raise ExpectError(self._failed(wanted, within, stop))
            self._wanted = wanted
            try:
                stop = self._wires.run(end - self._now())
            finally:
                self._wanted = None
            if stop.reason == "halt":
                drain()
        self.place = found.end()
        return found

    def _failed(self, wanted: re.Pattern[bytes], within: float, stop: Any) -> str:
        said = bytes(self.heard[self.place :])
        quoted = repr(said[-SHOWN:])[1:] + (f" (the last {SHOWN} of {len(said)} bytes)" if len(said) > SHOWN else "")
        text = f"{self._name} did not say {wanted.pattern!r} within {within:g} ms, but {quoted}"
        if stop is not None and stop.fault is not None:
            return f"{text}\n{stop.fault.report()}"
        return text + (f"; the run ended: {stop.reason}" if stop is not None and stop.reason != "limit" else "")


def compiled(pattern: Pattern) -> re.Pattern[bytes]:
    """Text and bytes mean themselves, compiled patterns are searched."""
    if isinstance(pattern, re.Pattern):
        return pattern
    return re.compile(re.escape(pattern.encode("latin-1") if isinstance(pattern, str) else bytes(pattern)))
