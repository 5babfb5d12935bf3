"""Observation of a machine that runs instruction by instruction: cycles, breakpoints, a watched range, inputs.

Declared here for Python and in core/observed.c for C. One observation belongs to one machine.
"""

from __future__ import annotations

import ctypes
from typing import Final

from emu.avr.core.state import FLASH_BYTES, NEVER

WATCH_BYTES: Final = 64
"""Maximum number of watched bytes."""
INPUT_LOG_ROOM: Final = 512
"""Maximum number of logged inputs."""
STOP_NONE, STOP_PLACE, STOP_STEP, STOP_WRITE, STOP_LIMIT, STOP_INPUTS = range(6)
"""Reasons of a stop: none, a breakpoint, the number of steps, a watched byte, the last cycle, a log of inputs that is
half full."""


class LoggedInput(ctypes.Structure):
    """One input (`struct logged_input`)."""

    _fields_ = [("given", ctypes.c_uint64), ("at", ctypes.c_uint64), ("kind", ctypes.c_uint32),
                ("value", ctypes.c_uint32)]  # fmt: skip
    given: int
    """Cycle at which the machine was given the input."""
    at: int
    """Cycle from which it acts."""
    kind: int
    value: int


class Observation(ctypes.Structure):
    """Settings and results of an observed run (`struct observation`)."""

    _fields_ = [("steps", ctypes.c_uint64), ("last_cycle", ctypes.c_uint64),
                ("passed", ctypes.c_uint64), ("last", ctypes.c_uint64), ("reason", ctypes.c_uint32),
                ("watch_from", ctypes.c_uint16), ("watch_count", ctypes.c_uint16), ("site", ctypes.c_uint16),
                ("counting", ctypes.c_uint8), ("logging", ctypes.c_uint8),
                ("places", ctypes.c_uint8 * (FLASH_BYTES // 2)),
                ("cycles", ctypes.c_uint64 * (FLASH_BYTES // 2)), ("input_count", ctypes.c_uint64),
                ("inputs", LoggedInput * INPUT_LOG_ROOM)]  # fmt: skip
    steps: int
    last_cycle: int
    passed: int
    last: int
    reason: int
    watch_from: int
    watch_count: int
    site: int
    counting: int
    logging: int
    places: ctypes.Array[ctypes.c_uint8]
    cycles: ctypes.Array[ctypes.c_uint64]
    input_count: int
    inputs: ctypes.Array[LoggedInput]

    def __init__(self) -> None:
        super().__init__(passed=NEVER, last=NEVER)

    def watch(self, address: int, count: int) -> None:
        """Stop after an instruction that changes one of `count` bytes of data memory; 0: of none. Raises ValueError."""
        if not 0 <= count <= WATCH_BYTES:
            raise ValueError(f"{count} bytes cannot be watched; the maximum is {WATCH_BYTES}")
        self.watch_from, self.watch_count = address, count
