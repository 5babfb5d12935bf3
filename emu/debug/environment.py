"""The environment of a debugged machine (its trial), which can be rewound together with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from emu.machine.machine import Machine


class CheckpointResumedError(Exception):
    """Raised in a checkpoint, a forked copy of the process, when it is resumed in place of the process that left it
    `session_state`."""

    def __init__(self, session_state: Any) -> None:
        super().__init__("checkpoint resumed")
        self.session_state = session_state


class Environment(Protocol):
    """The world around the machine. It runs only together with the machine, and every run of it is the same."""

    @property
    def has_checkpoints(self) -> bool:
        """Whether the environment takes checkpoints and can therefore follow every step back. Without checkpoints each
        rewind repeats the run from its start."""

    def describe(self) -> list[tuple[str, str]]:
        """Return names and values of the environment's current state. The last value is a digest of the whole state."""

    def rewind(self, cycle: int, session_state: Any) -> Machine:
        """Go back to a state before `cycle` of the machine.

        If there is a checkpoint, the latest one before `cycle` is resumed with `session_state`, and this call does not
        return. Otherwise the run starts again, and the result is the new machine at its start.
        """

    def offer_checkpoint(self, near: int | None = None) -> None:
        """Give the environment an opportunity to take a checkpoint; the machine is in its present.

        The environment takes one if it is due, or if the last one is far from `near`, the cycle that the machine will
        run to. Raises CheckpointResumedError in the checkpoint when it is resumed.
        """
