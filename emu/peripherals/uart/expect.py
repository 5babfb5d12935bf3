"""Wait for output of the firmware, in simulated time.

Input: a pattern and a time limit. Output: the match, at the cycle in which its last byte has left the pin. Waiting is
deterministic: the same firmware and input give the same cycle.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, Final

from emu.peripherals.base import CpuSignals

Pattern = str | bytes | re.Pattern[bytes]
QUOTED_BYTES: Final = 200
"""Maximum number of received bytes that an error message quotes."""


class ExpectError(AssertionError):
    """The expected output did not arrive in time. The message quotes the output received instead."""


class OutputMatcher:
    """Collects the output of one UART and searches it for patterns."""

    def __init__(self, name: str, wires: CpuSignals, fcy: Callable[[], float], now: Callable[[], int]) -> None:
        self._name: Final = name
        self._wires: Final = wires
        self._fcy: Final = fcy
        self._now: Final = now
        self._pattern: re.Pattern[bytes] | None = None
        self.received: Final = bytearray()
        """All bytes received since the matcher was created."""
        self.position = 0
        """Offset after the last match, where the next search starts."""

    def on_byte(self, byte: int, _cycle: int) -> None:
        """Append a received byte. If the pattern matches, end the run."""
        self.received.append(byte & 0xFF)
        if self._pattern is not None and self._pattern.search(self.received, self.position):
            self._wires.end_run()

    def expect(self, pattern: Pattern, within: float, drain: Callable[[], None]) -> re.Match[bytes]:
        """Run the machine until `pattern` matches; see `Uart.expect`."""
        wanted = compile_pattern(pattern)
        cycles = max(1, round(within * self._fcy() / 1000))
        end = self._now() + cycles
        stop: Any = None
        while (found := wanted.search(self.received, self.position)) is None:
            if self._now() >= end or (stop is not None and stop.reason not in ("limit", "interrupted")):
                raise ExpectError(self._failure_message(pattern, within, stop))
            self._pattern = wanted
            try:
                stop = self._wires.run(end - self._now())
            finally:
                self._pattern = None
            if stop.reason == "halt":
                drain()
        self.position = found.end()
        return found

    def _failure_message(self, pattern: Pattern, within: float, stop: Any) -> str:
        output = bytes(self.received[self.position :])
        quoted = repr(output[-QUOTED_BYTES:])[1:] + (
            f" (the last {QUOTED_BYTES} of {len(output)} bytes)" if len(output) > QUOTED_BYTES else ""
        )
        wanted = pattern.pattern if isinstance(pattern, re.Pattern) else literal_bytes(pattern)
        text = f"{self._name} did not send {wanted!r} within {within:g} ms; it sent {quoted}"
        if stop is not None and stop.fault is not None:
            return f"{text}\n{stop.fault.report()}"
        return text + (f"; the run ended: {stop.reason}" if stop is not None and stop.reason != "limit" else "")


def literal_bytes(text: str | bytes) -> bytes:
    """Return the bytes of a text; characters are Latin-1."""
    return text.encode("latin-1") if isinstance(text, str) else bytes(text)


def compile_pattern(pattern: Pattern) -> re.Pattern[bytes]:
    """Return a regular expression. Text and bytes match literally; a compiled pattern is returned unchanged."""
    if isinstance(pattern, re.Pattern):
        return pattern
    return re.compile(re.escape(literal_bytes(pattern)))
