"""What ends a run from inside the core: resets the core causes, and debugger words."""

from __future__ import annotations

from typing import Final

RESTART: Final = "the program went to address 0 without a reset"
"""Not for the core but for whoever watches it: a null function pointer ends there."""


class DeviceReset(Exception):
    """The device resets; `cause` is the RCON bit (isa.md §14.6), the text says why. A `fault` is the program's."""

    def __init__(self, cause: str, detail: str, fault: bool) -> None:
        super().__init__(detail)
        self.cause: Final = cause
        self.detail: Final = detail
        self.fault: Final = fault


class IllegalOpcode(DeviceReset):
    """The word at PC is no instruction (isa.md §4.1)."""

    def __init__(self, word: int) -> None:
        super().__init__("IOPUWR", f"illegal opcode {word:06X}", fault=True)


class UninitialisedPointer(DeviceReset):
    """A W register that was never written is used as an address pointer (isa.md §2.2)."""

    def __init__(self, number: int) -> None:
        super().__init__("IOPUWR", f"W{number} is used as an address pointer before it was written", fault=True)


class TrapConflict(DeviceReset):
    """A lower hard trap arose while a higher one is pending or in progress (isa.md §14.4)."""

    def __init__(self, detail: str) -> None:
        super().__init__("TRAPR", f"trap conflict: {detail}", fault=True)


class Violation(Exception):
    """The instruction at `pc` has done what strict runs do not allow; the text says what."""

    def __init__(self, detail: str, pc: int) -> None:
        super().__init__(detail)
        self.pc: Final = pc


class Breakpoint(Exception):
    """A debugger word was executed: the run stops behind it (isa.md §4.1)."""
