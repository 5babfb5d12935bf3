"""Error of the machine verifier."""

from __future__ import annotations

from typing import NoReturn

from toolchain.mir.instruction import MI


class MachineError(AssertionError):
    """A rule of the verifier is violated, which is a bug of the compiler."""


def fail(rule: str, block: str, mi: MI | None = None) -> NoReturn:
    """Raise MachineError: `rule` is violated in a block, at `mi` if given."""
    raise MachineError(f"{rule}: block {block}" + (f": {mi!r}" if mi is not None else ""))
