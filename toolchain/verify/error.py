"""What the verifier says."""

from __future__ import annotations

from typing import NoReturn

from toolchain.mir.mir import MI


class MachineError(AssertionError):
    """A rule is broken: the fault is the compiler's."""


def fail(rule: str, block: str, mi: MI | None = None) -> NoReturn:
    """Raise MachineError for an instruction of a block."""
    raise MachineError(f"{rule}: block {block}" + (f": {mi!r}" if mi is not None else ""))
