"""`CommandRefusedError`: the reply to a command that the trial cannot execute."""

from __future__ import annotations


class CommandRefusedError(ValueError):
    """The session cannot execute a command in its present state, or the command is invalid."""
