"""Queue of frames for a UART's RX pin, each with its earliest start cycle.

The next `CAPACITY` frames are in the record. Further frames wait in a host-side backlog, which `Machine.snapshot`
appends to the copy of the record.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from struct import Struct
from typing import Final

from emu.system.record import Record
from emu.system.rules import Cell, cell_of

CAPACITY: Final = 1024
_FRAME: Final = Struct("<QHI")
"""A frame of the backlog: its fields in the order of `QueuedFrame`."""
_COMPACTED: Final = 1 << 16
"""Number of bytes of removed frames at which the backlog is compacted."""
FRAMING_ERROR: Final = 0x200
"""Error mark: the stop bit is low."""
PARITY_ERROR: Final = 0x400
"""Error mark: the parity bit is inverted."""
BREAK: Final = 0x800
"""Error mark: the line is low for the whole frame."""
WAIT_FOR_RECEIVER: Final = 0x1000
"""Mark: the frame waits until the receiver is enabled."""
ERRORS: Final = FRAMING_ERROR | PARITY_ERROR | BREAK


@dataclass(frozen=True, slots=True)
class QueuedFrame:
    """A queued frame: earliest start cycle, data with marks, bit time in Tcy/256 (0 = the receiver's)."""

    earliest: int
    data: int
    bit: int


@dataclass(frozen=True, slots=True)
class RxQueueOperands:
    """Operands of the rules: a ring of `CAPACITY` frames; `more` is 1 if the backlog holds further frames."""

    earliest: Cell
    bit: Cell
    data: Cell
    head: Cell
    count: Cell
    more: Cell


class RxQueue:
    """FIFO queue of frames towards the RX pin."""

    def __init__(self, record: Record, name: str) -> None:
        def reserve(purpose: str, kind: str, count: int = 1) -> int:
            return record.reserve(f"{name}.{purpose}", kind, count).index

        first = reserve("line.earliest", "Q", CAPACITY)
        self._earliest: Final = record.u64[first : first + CAPACITY]
        first = reserve("line.bit", "I", CAPACITY)
        self._bit: Final = record.u32[first : first + CAPACITY]
        first = reserve("line.data", "H", CAPACITY)
        self._data: Final = record.u16[first : first + CAPACITY]
        self._head: Final = reserve("line.head", "H")
        self._count: Final = reserve("line.count", "H")
        self._more: Final = reserve("line.more", "B")
        self._u16: Final = record.u16
        self._u8: Final = record.u8
        operands = (cell_of(record, f"{name}.line.{one.name}") for one in fields(RxQueueOperands))
        self.operands: Final = RxQueueOperands(*operands)
        """Operands for rules."""
        self._backlog = bytearray()
        """Packed frames that do not yet fit into the record, after `_first` bytes of removed frames."""
        self._first = 0

    def __len__(self) -> int:
        return self._u16[self._count] + (len(self._backlog) - self._first) // _FRAME.size

    def saved_backlog(self) -> bytes:
        """Return the frames that do not fit into the record, for `restore_backlog`."""
        return bytes(memoryview(self._backlog)[self._first :])

    def restore_backlog(self, saved: bytes) -> None:
        """Restore the frames that do not fit into the record. The record must already be restored."""
        self._backlog, self._first = bytearray(saved), 0

    def put(self, frames: Iterable[QueuedFrame]) -> None:
        """Append frames to the queue."""
        for frame in frames:
            self._backlog += _FRAME.pack(frame.earliest, frame.data, frame.bit)
        self._top_up()

    def head(self) -> QueuedFrame | None:
        """Return the next frame without removing it; None if the queue is empty."""
        if not self._u16[self._count]:
            return None
        index = self._u16[self._head]
        return QueuedFrame(self._earliest[index], self._data[index], self._bit[index])

    def drop(self) -> None:
        """Remove the next frame from the queue."""
        self._u16[self._head] = (self._u16[self._head] + 1) % CAPACITY
        self._u16[self._count] -= 1
        self._top_up()

    def _top_up(self) -> None:
        while self._first < len(self._backlog) and self._u16[self._count] < CAPACITY:
            tail = (self._u16[self._head] + self._u16[self._count]) % CAPACITY
            frame = _FRAME.unpack_from(self._backlog, self._first)
            self._earliest[tail], self._data[tail], self._bit[tail] = frame
            self._u16[self._count] += 1
            self._first += _FRAME.size
        if self._first == len(self._backlog) or self._first >= _COMPACTED:
            del self._backlog[: self._first]
            self._first = 0
        self._u8[self._more] = bool(self._backlog)
