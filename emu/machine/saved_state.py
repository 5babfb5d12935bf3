"""A machine's state as bytes: the record, then the UART input that does not fit into it.

The input follows the record, for each UART its length and its packed frames; without any input, nothing follows.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from emu.peripherals.uart.uart import Uart
from emu.system.record import Record

LENGTH_BYTES: Final = 4
"""Size of the length of a UART's waiting input."""


def save(record: Record, uarts: Collection[Uart]) -> bytes:
    """Return a copy of the record and of the waiting UART input, and change nothing."""
    backlogs = [uart.line.saved_backlog() for uart in uarts]
    if not any(backlogs):
        return record.snapshot()
    return record.snapshot() + b"".join(len(one).to_bytes(LENGTH_BYTES, "little") + one for one in backlogs)


def restore(record: Record, uarts: Collection[Uart], state: bytes) -> None:
    """Restore the record and the waiting UART input. Raises ValueError for another size, and then changes nothing."""
    backlogs = _backlogs_in(state, record.used, len(uarts))
    record.restore(state[: record.used])
    for uart, backlog in zip(uarts, backlogs, strict=True):
        uart.line.restore_backlog(backlog)


def _backlogs_in(state: bytes, at: int, count: int) -> list[bytes]:
    """Return the waiting input of each UART, which begins at `at`. Raises ValueError for another size."""
    if len(state) <= at:
        return [b""] * count
    backlogs = []
    for _ in range(count):
        length = int.from_bytes(state[at : at + LENGTH_BYTES], "little")
        backlogs.append(state[at + LENGTH_BYTES : at + LENGTH_BYTES + length])
        at += LENGTH_BYTES + length
    if at != len(state):
        raise ValueError(f"snapshot has {len(state)} bytes, expected {at} for this machine and its waiting input")
    return backlogs
