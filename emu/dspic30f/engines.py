"""Engines: implementations of the instruction loop between two boundaries, with equal states and equal cycles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Protocol

from emu.dspic30f.core import Core
from emu.system.native_handle import Native, Run

NAMES: Final = ("auto", "jit", "plain")
"""Names for `--engine`; `auto` is the fastest engine that the host supports."""


class Engine(Protocol):
    """Interface between the machine's run loop and an engine."""

    name: str

    def run(self, limit: int) -> None:
        """Run at least one instruction, from PC on, as long as no boundary has work, no hooked PC is reached and the
        cycle is below `limit`. Raises DeviceReset and Breakpoint as `Sequencer.execute` does."""

    def natively(self, limit: int) -> bool:
        """Run boundaries and instructions without Python as far as possible. Return False if the boundary at PC has
        still to be done, or has to be done again."""

    def forget(self) -> None:
        """Discard translations because the set of hooked addresses has changed."""

    def pass_limits(self, period: int, last: int) -> None:
        """Let native code pass limits without returning: it notes the cycle and continues to the next limit, `period`
        cycles later and at most at `last`. 0 switches this off."""

    def passed(self) -> list[int]:
        """Return the first boundary, in Tcy, at or after each limit that was passed since the last call."""

    def lend(self, run: Run) -> Native | None:
        """Let `natively` call `run` instead of native code, except while cycles or host time are measured. Return the
        addresses that `run` needs, or None for an engine without native code."""


class PlainEngine:
    """Engine that executes one instruction per call through the sequencer."""

    name = "plain"

    def __init__(self, core: Core) -> None:
        self._sequencer: Final = core.sequencer

    def run(self, limit: int) -> None:
        """Execute one instruction."""
        self._sequencer.execute()

    def natively(self, limit: int) -> bool:
        """Return False: this engine has no native code."""
        return False

    def forget(self) -> None:
        """Do nothing: this engine keeps no translations."""

    def pass_limits(self, period: int, last: int) -> None:
        """Do nothing: this engine returns at every limit."""

    def passed(self) -> list[int]:
        """Return an empty list: this engine passes no limit."""
        return []

    def lend(self, run: Run) -> None:
        """Return None: this engine has no native code."""


def make_engine(name: str, core: Core, pc_hooks: Mapping[int, Any]) -> Engine:
    """Return the engine called `name`. Raises ValueError for a name that is not one of NAMES."""
    if name not in NAMES:
        raise ValueError(f"there is no engine {name!r}; expected one of {', '.join(NAMES)}")
    if name == "plain":
        return PlainEngine(core)
    from emu.dspic30f.jit.engine import JitEngine  # imported here: the translator is slow to load

    return JitEngine(core, pc_hooks)
