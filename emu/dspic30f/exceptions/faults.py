"""Exceptions that end a run from inside the core: resets that the core causes, and debugger words."""

from __future__ import annotations

from typing import Final

RESTART: Final = "the program went to address 0 without a reset"
"""Message of debuggers, not of the core: a call through a null function pointer ends at address 0."""


class DeviceReset(Exception):
    """The device resets. `cause` is the RCON bit (isa.md §14.6). `fault` says whether the program is at fault."""

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
    """A lower hard trap arose while a higher one is pending or in progress (isa.md §14.4)."""

    def __init__(self, detail: str) -> None:
        super().__init__("TRAPR", f"trap conflict: {detail}", fault=True)


class Violation(Exception):
    """The instruction at `pc` violates a rule of strict runs, which the message names."""

    def __init__(self, detail: str, pc: int) -> None:
        super().__init__(detail)
        self.pc: Final = pc


class Breakpoint(Exception):
    """A debugger word was executed; the run stops after it (isa.md §4.1)."""
