"""`Native`: a machine as other compiled code runs it, without Python: `struct native` of arena/lockstep/lockstep.c.

In: nothing. Out: addresses of the host, valid as long as the machine is.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import Structure, c_int64, c_void_p
from typing import Final

Call = Callable[[int, int], int]
"""call(record, env): native code run from where the machine stands; what it came back for."""
Run = Callable[[Call, int, int], int]
"""run(call, record, env): as `call`, which it may call, by whatever means."""

FRESH_ROOM: Final = 8
"""Instructions that are remembered as waiting for a device, and a 0."""


class Native(Structure):
    """Fields of a struct, all 64 bits wide. Code is called as int64 entry(record, env)."""

    _fields_ = [
        *((name, c_void_p) for name in (
            "entry", "record", "env",
            "begins",  # uint64: whether to begin with the boundary before PC
            "limit", "last",  # uint64, cycles: where native code comes back; `Engine.pass_limits`
            "noted", "notes",  # uint64: how many limits have been passed, and where (`Engine.passed`)
            "fresh",  # uint64 [FRESH_ROOM]: instructions that read what a device brings up to date, 0 behind the last:
                      # PC + (index of the register << 32)
            "cycle", "now", "deadline",  # uint64: of the CPU, of the devices, of whatever is due first
            "pc",  # uint32
            "mode", "corcon", "ie0", "ie1", "ie2",  # uint16: mode of the CPU, and registers
        )),
        *((name, c_int64) for name in (
            "room",  # notes that are kept
            "interpret", "service",  # results: an instruction that needs Python; an event that does, or the limit
            "awake",  # the mode in which the CPU runs
            "trap",  # the bit of CORCON that is 1 while a trap is handled
        )),
    ]  # fmt: skip
