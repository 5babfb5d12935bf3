"""Log of input with the cycles of its arrival. A live session writes it, and a replay reads it.

The file is text with one line per arrival, `CYCLE UART HEX`, sorted by time. Lines that begin with # are comments.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TextIO

from emu.host.files import read_file

HEADER: Final = "# input stamps: cycle, UART, bytes in hex"


@dataclass(frozen=True, slots=True)
class TimestampedInput:
    """Input `data` that began to arrive at UART number `uart` at `cycle` (Tcy since power-on)."""

    cycle: int
    uart: int
    data: bytes

    def write(self, stream: TextIO) -> None:
        """Append this entry to an input log."""
        stream.write(f"{self.cycle} {self.uart} {self.data.hex()}\n")


def read_input_log(path: str, uarts: tuple[int, ...]) -> list[TimestampedInput]:
    """Read an input log. Raises ValueError with the line of the first error, OSError if it cannot be read."""
    stamps: list[TimestampedInput] = []
    for number, line in enumerate(read_file(path).decode("ascii", "replace").splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            cycle, uart, data = line.split()
            stamp = TimestampedInput(int(cycle), int(uart), bytes.fromhex(data))
        except ValueError:
            raise ValueError(f"{path}: line {number}: expected `CYCLE UART HEX`, found {line[:40]!r}") from None
        if stamp.uart not in uarts:
            raise ValueError(f"{path}: line {number}: there is no UART{stamp.uart}")
        if stamp.cycle < (stamps[-1].cycle if stamps else 0):
            raise ValueError(f"{path}: line {number}: cycle {stamp.cycle} is lower than that of the line before")
        stamps.append(stamp)
    return stamps
