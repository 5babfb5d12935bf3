"""Engines: implementations of the instruction loop between two boundaries. All give equal states and equal cycles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, Protocol

from emu.dspic30f.core import Core
from emu.system.hook_filters import Filter
from emu.system.native_handle import Native, Run

NAMES: Final = ("auto", "jit", "plain")
"""Engine names for `--engine`; `auto` selects the fastest engine that the host supports."""


class Engine(Protocol):
    """Interface between the machine's run loop and an engine."""

    name: str

    def run(self, limit: int) -> None:
        """Run at least one instruction, starting at PC.

        Continue until a boundary has work, a hooked PC is reached or the cycle is `limit` or later. Raises DeviceReset
        and DebuggerWord as `Sequencer.execute` does.
        """

    def natively(self, limit: int) -> bool:
        """Run boundaries and instructions without Python as far as possible.

        Return False if the caller still has to perform the boundary at PC, or has to repeat it.
        """

    def forget(self) -> None:
        """Discard translations because the set of hooked addresses has changed."""

    def skip_hooks_at(self, cycle: int) -> None:
        """Do not record the arrival at the instruction that starts in `cycle`: its hooks have been called."""

    def pass_limits(self, period: int, last: int) -> None:
        """Let native code pass limits without returning.

        It records the cycle of each limit and continues to the next one, `period` cycles later and at most at `last`.
        A period of 0 disables this.
        """

    def passed(self) -> list[int]:
        """Return, for each limit passed since the last call, the first boundary (Tcy) at or after it."""

    def attach_runner(self, run: Run) -> Native | None:
        """Make `natively` call `run` instead of native code, except while cycles or host time are measured.

        Return the addresses that `run` needs, None for an engine without native code.
        """


class PlainEngine:
    """Engine that executes one instruction per call through the sequencer."""

    name = "plain"

    def __init__(self, core: Core) -> None:
        self._sequencer: Final = core.sequencer

    def run(self, limit: int) -> None:
        """Execute one instruction."""
        self._sequencer.execute()

    def natively(self, limit: int) -> bool:
        """Return False, because this engine has no native code."""
        return False

    def forget(self) -> None:
        """Do nothing, because this engine keeps no translations."""

    def skip_hooks_at(self, cycle: int) -> None:
        """Do nothing, because the machine calls all hooks."""

    def pass_limits(self, period: int, last: int) -> None:
        """Do nothing, because this engine returns at every limit."""

    def passed(self) -> list[int]:
        """Return an empty list, because this engine passes no limits."""
        return []

    def attach_runner(self, run: Run) -> None:
        """Return None, because this engine has no native code."""


def make_engine(
    name: str,
    core: Core,
    pc_hooks: Mapping[int, Any],
    pc_filters: Mapping[int, Sequence[Filter | None]] = MappingProxyType({}),
) -> Engine:
    """Return the engine called `name`. Raises ValueError for a name that is not one of NAMES.

    `pc_filters` has the filter of each hook of an address. Native code may pass the address if none of them holds.
    """
    if name not in NAMES:
        raise ValueError(f"there is no engine {name!r}; expected one of {', '.join(NAMES)}")
    if name == "plain":
        return PlainEngine(core)
    from emu.dspic30f.jit.engine import JitEngine  # imported here: the translator is slow to load

    return JitEngine(core, pc_hooks, pc_filters)
