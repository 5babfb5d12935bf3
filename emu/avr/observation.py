"""Observation of a machine that runs instruction by instruction: cycles by instruction, breakpoints, a watched range.

Declared here for Python and in core/observed.c for C. One observation belongs to one machine.
"""

from __future__ import annotations

import ctypes
from typing import Final

from emu.avr.core.state import FLASH_BYTES, NEVER

WATCH_BYTES: Final = 64
"""Maximum number of watched bytes."""
STOP_NONE, STOP_PLACE, STOP_STEP, STOP_WRITE = range(4)
"""Reasons of a stop: none, a breakpoint, the number of steps, a change of a watched byte."""


class Observation(ctypes.Structure):
    """Settings and results of an observed run (`struct observation`)."""

    _fields_ = [("steps", ctypes.c_uint64), ("last_cycle", ctypes.c_uint64),
                ("passed", ctypes.c_uint64), ("reason", ctypes.c_uint32),
                ("watch_from", ctypes.c_uint16), ("watch_count", ctypes.c_uint16), ("site", ctypes.c_uint16),
                ("counting", ctypes.c_uint8), ("places", ctypes.c_uint8 * (FLASH_BYTES // 2)),
                ("cycles", ctypes.c_uint64 * (FLASH_BYTES // 2))]  # fmt: skip
    steps: int
    last_cycle: int
    passed: int
    reason: int
    watch_from: int
    watch_count: int
    site: int
    counting: int
    places: ctypes.Array[ctypes.c_uint8]
    cycles: ctypes.Array[ctypes.c_uint64]

    def __init__(self) -> None:
        super().__init__(passed=NEVER)

    def watch(self, address: int, count: int) -> None:
        """Stop after an instruction that changes one of `count` bytes of data memory; 0: of none. Raises ValueError."""
        if not 0 <= count <= WATCH_BYTES:
            raise ValueError(f"{count} bytes cannot be watched; the maximum is {WATCH_BYTES}")
        self.watch_from, self.watch_count = address, count
