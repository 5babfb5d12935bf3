"""Python exceptions by which the core ends a run: resets that the core causes, and debugger words."""

from __future__ import annotations

from typing import Final

RESTART: Final = "the program went to address 0 without a reset"
"""Message for a call through a null function pointer, which ends at address 0. Debuggers show it."""


class DeviceReset(Exception):
    """Reset of the device.

    `cause` is the RCON bit (isa.md §14.6). `fault` says whether the program caused it by an error.
    """

    def __init__(self, cause: str, detail: str, fault: bool) -> None:
        super().__init__(detail)
        self.cause: Final = cause
        self.detail: Final = detail
        self.fault: Final = fault


class IllegalOpcode(DeviceReset):
    """The word at PC is not an instruction (isa.md §4.1)."""

    def __init__(self, word: int) -> None:
        super().__init__("IOPUWR", f"illegal opcode {word:06X}", fault=True)


class UninitialisedPointer(DeviceReset):
    """An instruction uses an uninitialised W register as an address pointer (isa.md §2.2)."""

    def __init__(self, number: int) -> None:
        super().__init__("IOPUWR", f"W{number} is used as an address pointer before it was written", fault=True)


class TrapConflict(DeviceReset):
    """A hard trap occurred while one of higher level is pending or in progress (isa.md §14.4)."""

    def __init__(self, detail: str) -> None:
        super().__init__("TRAPR", f"trap conflict: {detail}", fault=True)


class Violation(Exception):
    """The instruction at `pc` violates a rule of strict mode, which the message describes."""

    def __init__(self, detail: str, pc: int) -> None:
        super().__init__(detail)
        self.pc: Final = pc


class DebuggerWord(Exception):
    """The program executed a debugger word; the run stops after it (isa.md §4.1)."""
