"""Engines: ways to run instructions between two boundaries. All give the same state in the same cycle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Protocol

from emu.dspic30f.core import Core
from emu.dspic30f.specialised.engine import SpecialisedEngine
from emu.system.native_handle import Native, Run

NAMES: Final = ("plain", "interp", "jit", "auto")


class Engine(Protocol):
    """What the machine's loop needs."""

    name: str

    def run(self, limit: int) -> None:
        """Run at least one instruction, from PC on, as long as no boundary has work, no hooked PC is reached and the
        cycle is below `limit`. Raises DeviceReset and Breakpoint as `Sequencer.execute` does."""

    def natively(self, limit: int) -> bool:
        """Boundaries and instructions without Python, as far as possible. False: the boundary at PC is yet to be done,
        or to be done again."""

    def forget(self) -> None:
        """Hooks have changed: whatever was prepared for them is stale."""

    def pass_limits(self, period: int, last: int) -> None:
        """From now on, a limit that is reached without Python may be passed: the next one is `period` later, `last` at
        most. 0: no limit is."""

    def passed(self) -> list[int]:
        """The first boundaries at or after the limits that were passed since the last call, in Tcy."""

    def lend(self, run: Run) -> Native | None:
        """From now on `run` is called where native code would be, in `natively`, while nobody counts or measures it; it
        finds what it needs in the result. None: there is no native code."""


class PlainEngine:
    """One instruction at a time through the sequencer."""

    name = "plain"

    def __init__(self, core: Core) -> None:
        self._sequencer: Final = core.sequencer

    def run(self, limit: int) -> None:
        """One instruction."""
        self._sequencer.execute()

    def natively(self, limit: int) -> bool:
        """Nothing is native."""
        return False

    def forget(self) -> None:
        """Nothing is prepared."""

    def pass_limits(self, period: int, last: int) -> None:
        """No limit is passed."""

    def passed(self) -> list[int]:
        """None."""
        return []

    def lend(self, run: Run) -> None:
        """There is nothing to lend."""


def make_engine(name: str, core: Core, pc_hooks: Mapping[int, Any]) -> Engine:
    """The engine called `name`. Raises ValueError for a name that is not one of NAMES."""
    if name not in NAMES:
        raise ValueError(f"there is no engine {name!r}; expected one of {', '.join(NAMES)}")
    if name == "plain":
        return PlainEngine(core)
    interpreter = SpecialisedEngine(core, pc_hooks)
    if name == "interp":
        return interpreter
    from emu.dspic30f.jit.engine import JitEngine  # only who runs native code pays for the translator

    return JitEngine(core, pc_hooks, interpreter)
