"""The environment of a debugged machine (its trial), which can be rewound together with the machine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from emu.machine.machine import Machine


class CheckpointResumedError(Exception):
    """Raised in a checkpoint when it is resumed.

    A checkpoint is a forked copy of the process. It replaces the process that passed it `session_state`.
    """

    def __init__(self, session_state: Any) -> None:
        super().__init__("checkpoint resumed")
        self.session_state = session_state


class Environment(Protocol):
    """The world around the machine. It runs only together with the machine, and all its runs are identical."""

    @property
    def has_checkpoints(self) -> bool:
        """Whether the environment takes checkpoints and can therefore follow every step back.

        Without checkpoints, each rewind repeats the run from its start.
        """

    def describe(self) -> list[tuple[str, str]]:
        """Return names and values of the environment's current state. The last value is a digest of the whole state."""

    def rewind(self, cycle: int, session_state: Any) -> Machine:
        """Rewind to a state before `cycle` of the machine.

        If a checkpoint exists, the latest one before `cycle` is resumed with `session_state`, and this call does not
        return. Otherwise the run is restarted, and the result is the new machine at its start.
        """

    def offer_checkpoint(self, near: int | None = None) -> None:
        """Let the environment take a checkpoint. The machine must be in its present.

        The environment takes one if it is due, or if the last one is far from `near`, the cycle to which the machine
        will run. Raises CheckpointResumedError in the checkpoint when it is resumed.
        """
