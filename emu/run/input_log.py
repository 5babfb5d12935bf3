"""Log of input with the cycle of its arrival, written by a live session and read by a replay.

The file is text, one line per arrival, `CYCLE UART HEX`, in order of time; lines that start with # are comments.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TextIO

from emu.host.files import read_file

HEADER: Final = "# input stamps: cycle, UART, bytes in hex"


@dataclass(frozen=True, slots=True)
class TimestampedInput:
    """`data` began to arrive at UART number `uart` at `cycle` (Tcy since power-on)."""

    cycle: int
    uart: int
    data: bytes

    def write(self, stream: TextIO) -> None:
        """Append the entry to an input log."""
        stream.write(f"{self.cycle} {self.uart} {self.data.hex()}\n")


def read_input_log(path: str, uarts: tuple[int, ...]) -> list[TimestampedInput]:
    """Read an input log. Raises ValueError with the line of the first error, OSError if unreadable."""
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
