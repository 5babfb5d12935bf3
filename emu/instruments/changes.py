"""Changes of watched numbers, logged in native code where possible (emu/dspic30f/change_log.py)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from emu.dspic30f.change_log import ChangeLog, Entries, Watched

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.system.hook_filters import Filter


def is_in_ram(machine: Machine, address: int, size: int) -> bool:
    """Whether native code can log changes of the `size` bytes at `address`."""
    ram = machine.chip.data["ram"]
    return size in (1, 2, 4, 8) and ram.start <= address <= ram.end - size


def log_changes(
    machine: Machine,
    watched: Sequence[Watched],
    consumer: Callable[[Entries], object],
    leaves: Filter | None = None,
    every_write: bool = False,
) -> Callable[[], None]:
    """Log the changes of `watched` to `consumer` while `machine` runs. Return the function that ends it.

    `consumer`, `leaves` and `every_write` are as for `ChangeLog`. Raises ValueError if another instrument runs.
    """
    log = ChangeLog(machine.core, watched, consumer, leaves, every_write)
    if machine.engine == "plain":
        log.start()
        return log.stop
    from emu.dspic30f.jit.counting import ChangeCounting
    from emu.dspic30f.jit.engine import JitEngine

    assert isinstance(machine.runner, JitEngine)
    return machine.runner.start_counting(ChangeCounting(machine.core, log))
