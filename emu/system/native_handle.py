"""C ABI of a machine: the handle `Native`, through which other compiled code runs a machine without Python.

Its C twin is `struct native` in arena/lockstep/lockstep.c. The host addresses in the handle are valid as long as
the machine exists.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import Structure, c_int64, c_void_p
from typing import Final

Call = Callable[[int, int], int]
"""call(record, env): runs native code from the current state of the machine and returns the exit reason."""
Run = Callable[[Call, int, int], int]
"""run(call, record, env): is called instead of `call` and may call `call` itself."""

FRESH_ROOM: Final = 8
"""Capacity of `Native.fresh`, including the terminating 0."""


class Native(Structure):
    """Handle of a machine: a struct of 64-bit fields. Native code is called as int64 entry(record, env)."""

    _fields_ = [
        *((name, c_void_p) for name in (
            "entry", "record", "env",
            "begins",  # uint64: whether a call begins with the boundary before the instruction at PC
            "limit", "last",  # uint64: cycles at which native code returns (`Engine.pass_limits`)
              "noted", "notes",  # uint64: number and cycles of the passed limits (`Engine.passed`)
            "fresh",  # uint64 [FRESH_ROOM], terminated by 0: instructions that read a register that a device
                      # refreshes, each as PC + (index of the register << 32)
            "cycle", "now", "deadline",  # uint64: cycle of the CPU, of the devices, of the earliest event
            "pc",  # uint32
            "mode", "corcon",  # uint16: mode of the CPU, and an SFR
        )),
        *((name, c_int64) for name in (
            "room",  # capacity of `notes`
            "interpret", "service",  # exit reasons: Python must do an instruction; or a boundary, or limit reached
            "awake",  # value of `mode` while the CPU runs
            "trap",  # bit of CORCON that is 1 while a trap is handled
        )),
    ]  # fmt: skip
