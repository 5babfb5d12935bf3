"""Queue of frames for a UART's RX pin, each with its earliest start cycle.

The next `CAPACITY` frames are in the record. Further frames wait in a host-side backlog, which snapshots do not
contain.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Final

from emu.system.record import Record
from emu.system.rules import Cell, cell_of

CAPACITY: Final = 1024
FRAMING_ERROR: Final = 0x200
"""The stop bit is low."""
PARITY_ERROR: Final = 0x400
"""The parity bit is inverted."""
BREAK: Final = 0x800
"""The line is low for the whole frame."""
WAIT_FOR_RECEIVER: Final = 0x1000
"""The frame waits until the receiver is enabled."""
ERRORS: Final = FRAMING_ERROR | PARITY_ERROR | BREAK


@dataclass(frozen=True, slots=True)
class QueuedFrame:
    """A queued frame: earliest start cycle, data with error marks, bit time in Tcy/256 (0 = the receiver's)."""

    earliest: int
    data: int
    bit: int


@dataclass(frozen=True, slots=True)
class RxQueueOperands:
    """Operands of the rules: a ring of `CAPACITY` frames, and whether the backlog holds more."""

    earliest: Cell
    bit: Cell
    data: Cell
    head: Cell
    count: Cell
    more: Cell


class RxQueue:
    """First-in, first-out queue of frames towards RX."""

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
        self.backlog: Final[deque[QueuedFrame]] = deque()
        """Frames that do not fit into the record yet."""

    def __len__(self) -> int:
        return self._u16[self._count] + len(self.backlog)

    def put(self, frames: Iterable[QueuedFrame]) -> None:
        """Append frames."""
        self.backlog.extend(frames)
        self._top_up()

    def head(self) -> QueuedFrame | None:
        """Return the next frame without removing it."""
        if not self._u16[self._count]:
            return None
        index = self._u16[self._head]
        return QueuedFrame(self._earliest[index], self._data[index], self._bit[index])

    def drop(self) -> None:
        """Remove the next frame."""
        self._u16[self._head] = (self._u16[self._head] + 1) % CAPACITY
        self._u16[self._count] -= 1
        self._top_up()

    def _top_up(self) -> None:
        while self.backlog and self._u16[self._count] < CAPACITY:
            frame = self.backlog.popleft()
            tail = (self._u16[self._head] + self._u16[self._count]) % CAPACITY
            self._earliest[tail], self._data[tail], self._bit[tail] = frame.earliest, frame.data, frame.bit
            self._u16[self._count] += 1
        self._u8[self._more] = bool(self.backlog)
