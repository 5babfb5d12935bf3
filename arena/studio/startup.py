"""`Startup`: creates the trial of a studio in a thread, so that its server can show the progress meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from threading import Thread
from typing import Final

from arena.campaign.campaign import Plan
from arena.studio.errors import CommandRefusedError
from arena.studio.process import Studio
from arena.trial.checkpoints import PATIENCE_S

STAGES: Final = ("check the scene and build its firmware", "start the process of the trial",
                 "place the robots and start their firmware")  # fmt: skip
"""What a page waits for, in order."""


class Startup:
    """Creation of the studio of the plan that `make_plan` returns; `start` begins it."""

    def __init__(self, make_plan: Callable[[], Plan]) -> None:
        self._make_plan: Final = make_plan
        self._thread: Thread | None = None
        self._studio: Studio | None = None
        self.stage = 0
        """Index in STAGES of the present stage; their number if the trial is ready."""
        self.error: Exception | None = None
        """Why the trial could not be created."""

    def start(self, on_failure: Callable[[], None]) -> None:
        """Begin to create the studio in a thread, which calls `on_failure` after it has set `error`."""
        self._thread = Thread(target=self._create, args=(on_failure,), daemon=True)
        self._thread.start()

    def _create(self, on_failure: Callable[[], None]) -> None:
        try:
            plan = self._make_plan()
            self.stage = 1
            self._studio = Studio(plan, plan.seed, self._on_process)
            self.stage = len(STAGES)
        except Exception as error:  # the main thread reports it
            self.error = error
            on_failure()

    def _on_process(self) -> None:
        self.stage = 2

    @property
    def studio(self) -> Studio:
        """The studio. Raises CommandRefusedError if it does not exist yet."""
        if self._studio is None:
            raise CommandRefusedError(f"the trial is not ready: it must {STAGES[self.stage]}")
        return self._studio

    @property
    def is_ready(self) -> bool:
        """Whether the studio exists."""
        return self._studio is not None

    def close(self) -> None:
        """End the trial and its process; a startup that takes long is abandoned."""
        if self._thread is not None:
            self._thread.join(PATIENCE_S)
        if self._studio is not None:
            self._studio.close()
