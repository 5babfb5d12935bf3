"""Interpreter loop for code without native translation: runs to a limit, a due event or a hooked address."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from emu.dspic30f.core import Core


class ColdRunner:
    """Interprets several instructions per call, to make lookups of native code rare."""

    def __init__(self, core: Core, pc_hooks: Mapping[int, Any]) -> None:
        self._core: Final = core
        self._hooks: Final = pc_hooks

    def run(self, limit: int) -> None:
        """Run at least one instruction. Stop at `limit`, at a due event, and before a hooked address."""
        core, hooks = self._core, self._hooks
        u32, u64, at = core.record.u32, core.record.u64, core.state.at
        cycle_index, pc_index, deadline_index = at["cpu.cycle"], at["cpu.pc"], core.events.deadline_index
        execute = core.sequencer.execute
        while True:
            execute()
            cycle = u64[cycle_index]
            if cycle >= limit or u64[deadline_index] < cycle or u32[pc_index] in hooks:
                return
